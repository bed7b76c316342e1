"""References that hold the wire at a displacement, or move it to another one.

The path of a move has the smallest possible jerk. Its greatest speed is `PEAK` times its mean speed.
"""

from __future__ import annotations

from math import isfinite

import numpy as np

from smadrive.control.references.reference import Reference
from smadrive.hysteresis import HysteresisModel
from smadrive.measurement import DisplacementFrom, Measurement
from smadrive.safety.displacement_band import DisplacementBand
from smadrive.wire.wire_model import travel_mm

APPROACH_S = 10.0
"""Duration of an approach, in which the setpoint moves from its present value to the beginning of a reference."""

UNSURE = 0.03
"""A displacement of a wire at rest that may be wrong by more than this needs a caveat, in strokes."""

WITHIN_C = 2.0
"""The temperature of a wire at rest may differ from the reading of the thermocouple by this much, K."""

PEAK = 1.875
"""Greatest speed of a minimum-jerk path, 15/8 of its mean speed."""


def constant_reference(at_mm: float) -> Reference:
    """Return a reference that stays at `at_mm`."""
    return Reference.from_samples([0.0, 1.0], [at_mm, at_mm])


def resting_mm(model: HysteresisModel, measurement: Measurement, source: DisplacementFrom) -> float:
    """Return the displacement of a wire at rest, mm: the measured one if a sensor is the source.

    If it is unknown, return the displacement that `model` has at the measured temperature after heating from cold.
    """
    if source is DisplacementFrom.SENSOR and isfinite(measurement.displacement_mm):
        return measurement.displacement_mm
    return model.initial_state(measurement.temperature_c).y


def resting_caveats(model: HysteresisModel, measurement: Measurement, source: DisplacementFrom) -> tuple[str, ...]:
    """Return a caveat if `resting_mm` may be wrong: its sensor has a wrong zero, or nothing measures a warm wire.

    Without a sensor the wire is on the cooling branch if it still cools, and `resting_mm` assumes the heating branch. A
    resistance measures the displacement as soon as current flows, so there is no caveat if it is the source.
    """
    if source is DisplacementFrom.RESISTANCE:
        return ()
    if source is DisplacementFrom.SENSOR and isfinite(measurement.displacement_mm):
        return _zero_caveats(model, measurement)
    at_c = np.array([measurement.temperature_c])
    heating, cooling = (float(model.branch(at_c, rising=rising)[0]) for rising in (True, False))
    wrong_mm = abs(model.scale * (cooling - heating))
    if not wrong_mm > UNSURE * travel_mm(model).stroke_mm:
        return ()
    warm = f"the wire is still at {measurement.temperature_c:.0f} °C, and its displacement is not measured"
    return (f"{warm}: the displacement at the start may be wrong by up to {wrong_mm:.2g} mm; let the wire cool first",)


def _zero_caveats(model: HysteresisModel, measurement: Measurement) -> tuple[str, ...]:
    """Return a caveat if the measured displacement is outside the loop of the model at this temperature."""
    reading_c, displacement_mm, band = measurement.temperature_c, measurement.displacement_mm, DisplacementBand(model)
    ends_c = (reading_c - WITHIN_C, reading_c + WITHIN_C)
    outside_mm = min(abs(displacement_mm - band.nearest_mm(one_c, displacement_mm)) for one_c in ends_c)
    if not outside_mm > UNSURE * travel_mm(model).stroke_mm:
        return ()
    shown = f"the displacement sensor shows {displacement_mm:.3g} mm at {reading_c:.0f} °C"
    loop = f"which is {outside_mm:.2g} mm outside the loop of the model"
    return (f"{shown}, {loop}: check the zero and the mount of the sensor, or identify the wire again",)


def holding_reference(model: HysteresisModel, measurement: Measurement, source: DisplacementFrom) -> Reference:
    """Return a constant reference at the displacement of a wire at rest (`resting_mm`).

    The displacement is limited to the range of the model at this temperature, so that a sensor with a wrong zero
    does not make the controller heat a cold wire.
    """
    at_mm = resting_mm(model, measurement, source)
    return constant_reference(DisplacementBand(model).nearest_mm(measurement.temperature_c, at_mm))


def moving_reference(from_mm: float, to_mm: float, speed_mm_per_s: float) -> Reference:
    """Return a reference that moves from `from_mm` to `to_mm` with at most `speed_mm_per_s`, and then stays.

    `scored_from_s` of the reference is the duration of the move.
    """
    return constant_reference(to_mm).with_approach(from_mm, PEAK * abs(to_mm - from_mm) / speed_mm_per_s)
