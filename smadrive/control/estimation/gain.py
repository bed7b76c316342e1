"""Kalman gains of the observer, from the heat balance and the slope of the hysteresis model.

The model is linearised at a slope s = dξ/dT of the phase. Over one period Δt the state becomes T', T_tc', d', b', ξ':

    T'  = κ T + (1-κ) d/(h A)        T_tc' = λ T_tc + (1-λ) T        ξ' = ξ + s (T' - T - (b' - b))
    d'  = d                          b'    = b

    κ = exp(-Δt h A/(m c + Q s))     λ = exp(-Δt/lag)

T is the temperature of the wire, T_tc of the thermocouple, d the power that the heat balance does not explain, b the
shift of the transformation (a heavier load shifts it to higher temperatures), ξ the phase. m c, Q, h A and lag are
parameters of the heat balance: heat capacity, latent heat, heat loss, thermocouple lag. d and b are random walks. A
step δb of the shift also warms the wire, because the phase falls and frees its latent heat:

    m c δT + Q δξ = 0    and    δξ = s (δT - δb)    so    δT = δb Q s/(m c + Q s)

T_tc and ξ are measured. Only s varies along the loop. The gain is the stationary solution of the discrete Riccati
equation. There is one gain for the thermocouple alone. For thermocouple and displacement together there is one gain for
each of several slopes. The two sensors together tell a draft from a load: a draft and a load both change ξ, but only
the draft cools the wire.

Each gain is solved twice: for calm air, where d and b drift slowly, and for a disturbance, where they change within a
second, and where the phase may change although the model expects no change. The gain for a disturbance is larger: it
follows a disturbance, but also the noise. The innovation test (innovation.py) decides between these two gains.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from math import exp, log
from typing import NamedTuple

import numpy as np
import scipy

from smadrive.control.estimation.innovation import DisturbanceEvidence
from smadrive.control.estimation.process_noise import NOISY, PRECISE, ProcessNoise
from smadrive.numerics.arrays import FloatArray
from smadrive.wire.heat_balance import HeatBalance
from smadrive.wire.wire_model import WireModel

GainRows = tuple[tuple[float, ...], ...]

Innovations = tuple[tuple[float, float, float, float], ...]
"""For each of the five estimates: the innovations of thermocouple and phase, and those that the larger gains act on."""

CACHED_GAINS = 4096
"""Number of gains that are cached: another controller for the same wire does not solve its gains again."""

SHIFT_S = 1000.0
"""The shift decays with this time constant, s. Without a decay the Riccati equation has no stationary solution."""

MOST_NOISES = 10.0
"""The gain for a disturbance applies to at most this many standard deviations of the noise in a single innovation."""

NOISES, NOISE_STEP = 5, 4.0
"""Number of displacement noises for which the gains are solved, and the ratio of two neighbouring noises."""

SLOPES = 9
"""Number of slopes for which the gain is solved, from zero to the steepest of the model."""

POINTS = 2000
"""Number of inputs at which the slope of the branches is examined."""


class Correction(NamedTuple):
    """The change of the observer's estimate after a measurement.

    temperature_c    change of the wire temperature, K
    thermocouple_c   change of the thermocouple's temperature, K
    disturbance_w    change of the power that the heat balance does not explain, W
    shift_c          change of the shift of the transformation, K
    phase            change of the phase, as a share of the travel
    """

    temperature_c: float
    thermocouple_c: float
    disturbance_w: float
    shift_c: float
    phase: float


class GainTable:
    """The Kalman gains of the observer for one wire, over the slope of the hysteresis model and the displacement noise.

    The phase is the displacement as a share of the travel. `noise_c` is the standard deviation of the noise of the
    thermocouple, K, and `noise` the smallest of the phase. The gains are solved for `NOISES` noises of the phase,
    because the noise of the resistance varies, and that of a sensor grows with the movement since its reading. Each
    is `NOISE_STEP` times the noise before. Between two noises the corrections are interpolated over the logarithm of
    the noise. A noise above the largest counts as the largest.
    """

    def __init__(self, wire: WireModel, period_s: float, noise_c: float, noise: float) -> None:
        balance, slopes = wire.balance, np.linspace(0.0, _steepest(wire), SLOPES).tolist()
        self._apart, self._last = slopes[1], NOISES - 1
        self._most_c = MOST_NOISES * noise_c
        self._noise, self._most_noise = noise, noise * NOISE_STEP**self._last
        self._reading = _more([_reading_gain(balance, period_s, noise_c, process) for process in PRECISE])
        self._both: list[list[GainRows]] = []
        for level in range(NOISES):
            noises_of_level = noise_c, noise * NOISE_STEP**level
            processes = NOISY if level else PRECISE
            self._both.append(
                [_more([_joint_gain(balance, s, period_s, *noises_of_level, one) for one in processes]) for s in slopes]
            )

    def by_reading(self, read_c: float, evidence: float) -> Correction:
        """Return the correction when only the thermocouple is measured. Shift and phase keep their values.

        `read_c` is measured - expected temperature of the thermocouple, K.
        """
        more_c = evidence * min(max(read_c, -self._most_c), self._most_c)
        wire, thermocouple, disturbance = (calm * read_c + more * more_c for calm, more in self._reading)
        return Correction(wire, thermocouple, disturbance, 0.0, 0.0)

    def by_both(
        self, slope: float, read_c: float, phase_error: float, evidence: DisturbanceEvidence, noise: float
    ) -> Correction:
        """Return the correction when thermocouple and displacement are measured.

        `slope` is the derivative of the phase with respect to the wire temperature, 1/K. `read_c` is measured -
        expected temperature of the thermocouple, K, and `phase_error` measured - expected phase, whose noise has the
        standard deviation `noise`. The levels of `evidence` go from 0, for the gains in calm air, to 1, for the gains
        in a disturbance: `level` for all estimates, `lasting` for shift and phase only. The larger gains apply to at
        most `MOST_NOISES` standard deviations of the noise, or to an innovation that repeats, because a spike of a
        sensor is no disturbance.
        """
        noise = min(max(noise, self._noise), self._most_noise)
        most, repeated = MOST_NOISES * noise, evidence.repeated
        limited_c = min(max(read_c, -self._most_c), self._most_c)
        limited = min(max(phase_error, min(-most, repeated)), max(most, repeated))
        thermal = read_c, phase_error, evidence.level * limited_c, evidence.level * limited
        lasting = max(evidence.level, evidence.lasting)
        hysteretic = read_c, phase_error, lasting * limited_c, lasting * limited
        innovations = thermal, thermal, thermal, hysteretic, hysteretic
        place = min(log(noise / self._noise, NOISE_STEP), self._last) if noise > self._noise else 0.0
        level = int(place)
        below = self._correction(level, slope, innovations)
        if place == level:
            return Correction(*below)
        above, share = self._correction(level + 1, slope, innovations), place - level
        return Correction(*[low + share * (high - low) for low, high in zip(below, above, strict=True)])

    def _correction(self, level: int, slope: float, innovations: Innovations) -> list[float]:
        """Return the correction by the gains of one noise, interpolated between the two slopes next to `slope`."""
        place = min(max(slope / self._apart, 0.0), SLOPES - 1.0)
        cell = min(int(place), SLOPES - 2)
        above = place - cell
        below = 1.0 - above
        return [
            (below * a0 + above * a1) * read_c
            + (below * b0 + above * b1) * phase_error
            + (below * c0 + above * c1) * more_c
            + (below * d0 + above * d1) * more
            for (a0, b0, c0, d0), (a1, b1, c1, d1), (read_c, phase_error, more_c, more) in zip(
                self._both[level][cell], self._both[level][cell + 1], innovations, strict=True
            )
        ]


def _more(gains: Sequence[GainRows]) -> GainRows:
    """Return the gains in calm air, and beside them by how much the gains in a disturbance are larger."""
    calm, disturbed = gains
    pairs = zip(calm, disturbed, strict=True)
    return tuple((*one, *(more - less for less, more in zip(one, other, strict=True))) for one, other in pairs)


def _reading_gain(balance: HeatBalance, period_s: float, noise_c: float, process_noise: ProcessNoise) -> GainRows:
    transition, process = _thermal(balance, period_s, 0.0, process_noise)
    gain = _gain(transition, np.array([[0.0, 1.0, 0.0]]), process, np.array([[noise_c**2]]))
    return tuple((of_reading,) for (of_reading,) in gain.tolist())


@lru_cache(CACHED_GAINS)
def _joint_gain(
    balance: HeatBalance,
    slope: float,
    period_s: float,
    noise_c: float,
    noise: float,
    process_noise: ProcessNoise,
) -> GainRows:
    transition, process = np.eye(5), np.zeros((5, 5))
    transition[:3, :3], process[:3, :3] = _thermal(balance, period_s, slope, process_noise)
    transition[3, 3] = exp(-period_s / SHIFT_S)
    transition[4, :3] = slope * (transition[0, :3] - [1.0, 0.0, 0.0])
    process[0, 4] = process[4, 0] = slope * process[0, 0]
    process[4, 4] = slope**2 * process[0, 0] + period_s * process_noise.phase**2
    latent_j_per_k = balance.latent_heat_j * slope
    warmer = latent_j_per_k / (balance.heat_capacity_j_per_k + latent_j_per_k)
    of_shift = process_noise.shift_c * np.array([warmer, 0.0, 0.0, 1.0, slope * (warmer - 1.0)])
    process += period_s * np.outer(of_shift, of_shift)
    reads = np.zeros((2, 5))
    reads[0, 1] = reads[1, 4] = 1.0
    gain = _gain(transition, reads, process, np.diag([noise_c**2, noise**2]))
    return tuple((of_reading, of_phase) for of_reading, of_phase in gain.tolist())


def _thermal(balance: HeatBalance, period_s: float, slope: float, noise: ProcessNoise) -> tuple[FloatArray, FloatArray]:
    """Return the transition and the process noise of (T, T_tc, d) over one period, both of shape (3, 3)."""
    capacity = balance.heat_capacity_j_per_k + balance.latent_heat_j * slope
    keep = exp(-period_s * balance.loss_w_per_k / capacity)
    follow = 1.0 - exp(-period_s / max(balance.thermocouple_lag_s, 1e-3))
    transition = np.array(
        [[keep, 0.0, (1.0 - keep) / balance.loss_w_per_k], [follow, 1.0 - follow, 0.0], [0.0, 0.0, 1.0]]
    )
    drift_w = noise.drift_c * balance.loss_w_per_k
    return transition, period_s * np.diag([noise.wire_c**2, (0.1 * noise.wire_c) ** 2, drift_w**2])


def _gain(transition: FloatArray, reads: FloatArray, process: FloatArray, noise: FloatArray) -> FloatArray:
    covariance = np.asarray(scipy.linalg.solve_discrete_are(transition.T, reads.T, process, noise), dtype=np.float64)
    gain: FloatArray = covariance @ reads.T @ np.linalg.inv(reads @ covariance @ reads.T + noise)
    return gain


def _steepest(wire: WireModel) -> float:
    """Return the largest slope of the phase on the branches of the major loop, in 1/K."""
    model = wire.model
    inputs = np.linspace(*model.input_range, POINTS)
    steepest = max(float(model.branch_slope(inputs, rising=rising).max()) for rising in (True, False))
    return steepest * abs(model.scale / wire.travel_mm)
