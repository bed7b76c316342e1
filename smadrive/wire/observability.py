"""The observability of the displacement by the resistance, along the two branches of the loop.

Along a branch the temperature changes together with the phase ξ, so R(T(ξ), ξ) may rise and fall again, because of the
temperature coefficients or of an R-phase. Then one resistance belongs to two displacements of the branch. The
thermocouple distinguishes these displacements, but the resistance alone does not: this band is lost.

At a known temperature the standard deviation of one sample is σ_U / (I |dR/dξ|) strokes; see identified_resistance.py.

The resolution of the device limits the displacement, too: a quantum q makes an error of up to q/2, and while the
current is steady, this error does not average out. In the middle of the cooling branch, held by the current I at the
voltage U, the error of the displacement is up to

    (q_U / 2U + q_I / 2I) R / |dR/dξ|  strokes

q_U and q_I are the quanta of voltage and current, and R is the resistance.
"""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

import numpy as np

from smadrive.numerics.arrays import FloatArray
from smadrive.wire.identified_resistance import WireResistance
from smadrive.wire.wire_model import WireModel

POINTS = 400
"""Number of temperatures at which a branch is examined."""

ENDS = 0.03
"""This share of the stroke is left out at both ends: there the displacement hardly changes with the temperature."""


class BranchResistance(NamedTuple):
    """One branch of the loop, from cold to hot: temperature in °C, phase, and resistance in Ω, each (points,)."""

    temperature_c: FloatArray
    phase: FloatArray
    ohm: FloatArray


def branch_of(wire: WireModel, resistance: WireResistance, *, rising: bool) -> BranchResistance:
    """Return the heating branch if `rising`, otherwise the cooling branch."""
    model = wire.model
    temperature_c = np.linspace(*model.input_range, POINTS)
    y = model.offset + model.scale * model.branch(temperature_c, rising=rising)
    phase = np.maximum.accumulate(wire.phase_at(y))
    ohm = np.array([resistance.ohm(*place) for place in zip(temperature_c.tolist(), phase.tolist(), strict=True)])
    return BranchResistance(temperature_c, phase, ohm)


def lost_band(wire: WireModel, resistance: WireResistance, *, rising: bool) -> tuple[float, float] | None:
    """Return the ends, mm, of the band of a branch in which the resistance alone does not tell the displacement.

    None if the resistance changes in one direction along the whole branch.
    """
    branch = branch_of(wire, resistance, rising=rising)
    inside = (branch.phase > ENDS) & (branch.phase < 1.0 - ENDS)
    ohm, phase = branch.ohm[inside], branch.phase[inside]
    if ohm.size < 3:
        return None
    falling = -ohm if ohm[-1] > ohm[0] else ohm
    earlier = np.concatenate(([np.inf], np.minimum.accumulate(falling)[:-1]))
    later = np.concatenate((np.maximum.accumulate(falling[::-1])[::-1][1:], [-np.inf]))
    lost = np.flatnonzero((falling >= earlier) | (falling <= later))
    if not lost.size:
        return None
    low, high = wire.displacement_mm(phase[lost[[0, -1]]])
    return float(min(low, high)), float(max(low, high))


COLD_PHASE, COLD_MARGIN_C = 0.002, 2.0
"""The wire is cold below the temperature at which its cooling branch has this phase, minus this margin in K."""


def cold_c(wire: WireModel, resistance: WireResistance) -> float:
    """Return the temperature below which the wire is martensite after any history, °C."""
    cooling = branch_of(wire, resistance, rising=False)
    cold = np.flatnonzero(cooling.phase <= COLD_PHASE)
    return float(cooling.temperature_c[cold[-1] if cold.size else 0]) - COLD_MARGIN_C


class SenseCurrent(NamedTuple):
    """The sense current, A, with the noise of one sample in strokes, and its heat as a share of the heat loss."""

    current_a: float
    noise: float
    heat: float


SENSE_NOISE, SENSE_HEAT = 0.05, 0.05
"""Largest noise of one sample, in strokes, and largest heat by the sense current, as a share of the heat loss."""

LEAD_OHM = 0.01
"""A change of leads and contacts, as new plugs or clamps make it, Ω."""


def sense_current(wire: WireModel, resistance: WireResistance) -> SenseCurrent:
    """Return the least current that keeps the resistance observable while the wire cools.

    It is the smallest current with a noise of at most `SENSE_NOISE`, or the current with the heat `SENSE_HEAT` if that
    current is smaller. Noise and heat are those in the middle of the cooling branch, at the phase 0.5.
    """
    middle_c = _cooling_middle_c(wire, resistance)
    ohm, slope = resistance.ohm(middle_c, 0.5), abs(resistance.ohm_per_phase(middle_c, 0.5))
    loss_w = wire.balance.loss_w_per_k * max(middle_c - wire.balance.ambient_c, 1.0)
    current_a = min(resistance.noise_v / (SENSE_NOISE * slope), float(np.sqrt(SENSE_HEAT * loss_w / ohm)))
    return SenseCurrent(current_a, resistance.noise_v / (current_a * slope), current_a**2 * ohm / loss_w)


COARSE, TOO_COARSE = 0.02, 0.1
"""Bounds of the error by the resolution, in strokes.

A run by resistance gets a warning above `COARSE`. Above `TOO_COARSE` it is refused, and other runs do not use the
resistance.
"""


def resolution_error(wire: WireModel, resistance: WireResistance, quantum_a: float, quantum_v: float) -> float:
    """Return the largest error of the displacement by the resolution, in strokes: see the head of this file."""
    cooling = branch_of(wire, resistance, rising=False)
    middle = int(abs(cooling.phase - 0.5).argmin())
    temperature_c, ohm = float(cooling.temperature_c[middle]), float(cooling.ohm[middle])
    held_a = sqrt(max(wire.balance.power_w(temperature_c, 0.0, 0.0), 1e-9) / ohm)
    share = 0.5 * quantum_v / (held_a * ohm) + 0.5 * quantum_a / held_a
    return share * ohm / abs(resistance.ohm_per_phase(temperature_c, 0.5))


def resolution_text(measured: str, error: float) -> tuple[str, ...]:
    """Return a sentence with the error by the resolution of `measured`, in strokes; none below `COARSE`."""
    if error < COARSE:
        return ()
    effect = "makes the displacement by the resistance wrong by up to"
    return (f"the resolution of {measured} alone {effect} {100 * error:.1f} % of the stroke",)


def sense_text(wire: WireModel, resistance: WireResistance) -> str:
    """Return a sentence with the sense current, its heat as a share of the heat loss, and the noise of one sample.

    The noise is the standard deviation of one displacement sample at this current, as a share of the stroke.
    """
    sense = sense_current(wire, resistance)
    heat = f"the sense current of {1e3 * sense.current_a:.0f} mA heats with {100 * sense.heat:.1f} % of the heat loss"
    return f"{heat}, and one sample then has a noise of {100 * sense.noise:.1f} % of the stroke"


def lead_error(wire: WireModel, resistance: WireResistance) -> float:
    """Return the error of the displacement, in strokes, if leads and contacts change by `LEAD_OHM` during a run.

    Two-wire sensing measures them together with the wire. The error is that in the middle of the cooling branch.
    """
    return LEAD_OHM / abs(resistance.ohm_per_phase(_cooling_middle_c(wire, resistance), 0.5))


def lead_text(wire: WireModel, resistance: WireResistance) -> str:
    """Return a sentence with the error of the displacement by a change of leads and contacts."""
    cost = f"a change of {1e3 * LEAD_OHM:.0f} mΩ makes an error of {100 * lead_error(wire, resistance):.2g} %"
    return f"the resistance includes leads and contacts: {cost} of the stroke, unless a run begins with a cold wire"


def lost_text(wire: WireModel, resistance: WireResistance) -> tuple[str, ...]:
    """Return one sentence for each branch with a band in which the resistance alone does not tell the displacement."""
    sentences = []
    for rising, way in ((True, "heating"), (False, "cooling")):
        if (band := lost_band(wire, resistance, rising=rising)) is not None:
            where = f"on {way}, from {band[0]:.2g} to {band[1]:.2g} mm"
            sentences.append(f"{where}, the resistance alone does not tell the displacement: the temperature must help")
    return tuple(sentences)


def _cooling_middle_c(wire: WireModel, resistance: WireResistance) -> float:
    """Return the temperature at which the cooling branch has the phase 0.5, °C."""
    branch = branch_of(wire, resistance, rising=False)
    return float(np.interp(0.5, branch.phase, branch.temperature_c))
