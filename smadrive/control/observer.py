"""Where the wire is: its own temperature and phase, from heater power and a lagging, noisy thermocouple.

State x = (T, T_tc, d): wire temperature, thermocouple temperature, and a slowly drifting power d that the heat balance
does not explain (draught, wrong h A), without which the estimate would be biased wherever the model is. The prediction
is the heat balance with the transformation's latent heat; the correction is a stationary Kalman gain, solved once from
the discrete Riccati equation. The hysteresis state follows the estimated temperature through a dead band: noise that
turns back and forth would otherwise ratchet the model.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import exp, isfinite

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_discrete_are

from smadrive.hysteresis import HysteresisModel, HysteresisState
from smadrive.hysteresis.reversal import DeadBand
from smadrive.thermal import HeatBalance

PROCESS_NOISE_C = 0.015
"""What the heat balance misses in the wire temperature: standard deviation after one second, K."""

DRIFT_NOISE_C = 0.2
"""How the unexplained power drifts: standard deviation after one second, in K of ambient temperature (times h A)."""

DEAD_BAND_NOISES = 0.5
"""Radius of the reversal dead band in standard deviations of the thermocouple's noise (the estimate is quieter)."""


@dataclass(frozen=True, slots=True)
class WireEstimate:
    """What the observer believes: wire temperature, hysteresis state (v, w, y), power that the balance misses."""

    temperature_c: float
    hysteresis: HysteresisState
    disturbance_w: float


class WireObserver:
    """The observer above.

    `noise_c` is the standard deviation of the thermocouple's noise, `period_s` the nominal update period for which the
    gain is solved.
    """

    def __init__(self, balance: HeatBalance, model: HysteresisModel, period_s: float, noise_c: float) -> None:
        self._balance = balance
        self._model = model
        self._gain = _stationary_gain(balance, period_s, noise_c)
        self._dead_band = DeadBand(DEAD_BAND_NOISES * noise_c)
        self._reading_c = 0.0

    def start(self, reading_c: float, displacement_mm: float) -> WireEstimate:
        """The estimate for a wire at rest: at the displacement, if it is measured, else on the heating branch."""
        self._reading_c = reading_c
        self._dead_band = DeadBand(self._dead_band.radius)
        measured_mm = displacement_mm if isfinite(displacement_mm) else None
        hysteresis = self._model.initial_state(self._dead_band.update(reading_c), measured_mm)
        return WireEstimate(reading_c, hysteresis, 0.0)

    def take_over(self, before: WireObserver, estimate: WireEstimate) -> WireEstimate:
        """The estimate of the observer `before`, of the same wire, in the terms of this one's model."""
        self._reading_c, self._dead_band = before._reading_c, before._dead_band
        hysteresis = self._model.initial_state(estimate.hysteresis.v, estimate.hysteresis.y)
        return WireEstimate(estimate.temperature_c, hysteresis, estimate.disturbance_w)

    def update(self, before: WireEstimate, reading_c: float, power_w: float, dt_s: float) -> WireEstimate:
        """The estimate `dt_s` after `before`, with `power_w` applied since and `reading_c` read now (NaN: none)."""
        power_w += before.disturbance_w
        wire_c = self._balance.step(before.temperature_c, power_w, self._phase_per_k(before, power_w), dt_s)
        expected_c = self._balance.step_thermocouple(self._reading_c, before.temperature_c, wire_c, dt_s)
        innovation_c = reading_c - expected_c if isfinite(reading_c) else 0.0
        wire_c += self._gain[0] * innovation_c
        self._reading_c = expected_c + self._gain[1] * innovation_c
        return WireEstimate(
            wire_c,
            self._model.step(before.hysteresis, self._dead_band.update(wire_c)),
            before.disturbance_w + self._gain[2] * innovation_c,
        )

    def _phase_per_k(self, estimate: WireEstimate, power_w: float) -> float:
        """dw/dT in the direction in which the power drives the wire."""
        settled_c = self._balance.ambient_c + power_w / self._balance.loss_w_per_k
        direction = 1 if settled_c > estimate.temperature_c else -1
        return self._model.slope(estimate.hysteresis, direction) / self._model.scale


def _stationary_gain(balance: HeatBalance, period_s: float, noise_c: float) -> tuple[float, float, float]:
    """Kalman gain of (T, T_tc, d) for the reading T_tc, from the discrete algebraic Riccati equation."""
    keep = exp(-period_s / balance.time_constant_s)
    follow = 1.0 - exp(-period_s / max(balance.thermocouple_lag_s, 1e-3))
    transition = np.array(
        [[keep, 0.0, (1.0 - keep) / balance.loss_w_per_k], [follow, 1.0 - follow, 0.0], [0.0, 0.0, 1.0]]
    )
    reads = np.array([[0.0, 1.0, 0.0]])
    drift_w = DRIFT_NOISE_C * balance.loss_w_per_k
    process = period_s * np.diag([PROCESS_NOISE_C**2, (0.1 * PROCESS_NOISE_C) ** 2, drift_w**2])
    noise = np.array([[noise_c**2]])
    covariance: NDArray[np.float64] = solve_discrete_are(transition.T, reads.T, process, noise)
    gain = (covariance @ reads.T / (reads @ covariance @ reads.T + noise)).ravel()
    return float(gain[0]), float(gain[1]), float(gain[2])
