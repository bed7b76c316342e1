"""The simulation of wire and thermocouple along a record, from heater power and phase.

    m c dT/dt = P - Q dw/dt - h A (T - T_a)        lag dT_tc/dt = T - T_tc

With P(t) and w(t) given, both equations are first-order filters, which are solved exactly. The heat balance has small
errors: leads and contacts count as power of the wire, and the noise of the displacement as latent heat. The reading
shows these errors, because it contradicts the simulated reading.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from smadrive.numerics.arrays import FloatArray
from smadrive.wire.heat_balance import HeatBalance

BANDS_HZ = 0.05, 0.2
"""The estimate of the wire temperature follows the thermocouple up to a frequency between these two.

Above this frequency it follows the heat balance, whose errors repeat with the loops of an excitation: at 0.05 to
0.1 Hz. The hysteresis model would take them for a property of the wire. So the frequency is as high as `PASSED_C`
permits.
"""

PASSED_C = 0.018
"""Largest noise that passes to the estimate above the lower of `BANDS_HZ`, K."""

NAMES = {
    "heat_capacity_j_per_k": "heat capacity m c",
    "loss_w_per_k": "loss h A",
    "latent_heat_j": "latent heat Q",
    "ambient_c": "ambient temperature",
    "thermocouple_lag_s": "thermocouple lag",
}
"""The parameters of the fit in their order, with their names in messages."""


@dataclass(frozen=True)
class Samples:
    """The excitation on a uniform time grid."""

    dt_s: float
    power_w: FloatArray
    reading_c: FloatArray
    phase: FloatArray


def parameters_of(balance: HeatBalance) -> FloatArray:
    """Return the parameters of the fit in the order of `NAMES`."""
    return np.array([getattr(balance, name) for name in NAMES])


def simulate(samples: Samples, parameters: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return wire temperature and reading for the parameters (m c, h A, Q, T_a, lag).

    The power of a sample belongs to the period before the sample; the phase is linear over each period.
    """
    capacity, loss, latent, ambient, lag = parameters
    net_w = samples.power_w[1:] - latent * np.diff(samples.phase) / samples.dt_s
    wire = ambient + _first_order(net_w / loss, capacity / loss, samples.dt_s, samples.reading_c[0] - ambient)
    return wire, _lagged(wire, lag, samples.dt_s, samples.reading_c[0])


def _first_order(target: FloatArray, time_constant_s: float, dt_s: float, start: float) -> FloatArray:
    """Solve dx/dt = (target - x)/τ for a target that is constant over each period, from x = `start`."""
    decay = np.exp(-dt_s / time_constant_s)
    tail, _ = scipy.signal.lfilter([1.0 - decay], [1.0, -decay], target, zi=[decay * start])
    return np.concatenate(([start], tail))


def _lagged(wire: FloatArray, lag_s: float, dt_s: float, start: float) -> FloatArray:
    """Return the reading of a thermocouple with a first-order lag, for a piecewise linear wire temperature."""
    decay = np.exp(-dt_s / lag_s)
    gain = 1.0 - (1.0 - decay) * lag_s / dt_s
    driven = (1.0 - decay - gain) * wire[:-1] + gain * wire[1:]
    tail, _ = scipy.signal.lfilter([1.0], [1.0, -decay], driven, zi=[decay * start])
    return np.concatenate(([start], tail))


def wire_temperature_c(samples: Samples, balance: HeatBalance) -> FloatArray:
    """Return the wire temperature: simulated, and corrected by the slow part of the error of the reading.

    A spike of one sample does not count. The correction is advanced by the lag of the thermocouple.
    """
    wire, reading = simulate(samples, parameters_of(balance))
    rate_hz = 1.0 / samples.dt_s
    low_pass = scipy.signal.butter(2, _followed_hz(rate_hz, balance.thermocouple_noise_c), fs=rate_hz, output="sos")
    error_c = scipy.ndimage.median_filter(samples.reading_c - reading, size=3, mode="nearest")
    slow_c = np.asarray(scipy.signal.sosfiltfilt(low_pass, error_c))
    return wire + slow_c + balance.thermocouple_lag_s * np.gradient(slow_c, samples.dt_s)


def _followed_hz(rate_hz: float, noise_c: float) -> float:
    """Return the frequency up to which the estimate follows a thermocouple with the noise `noise_c`, Hz.

    Of white noise with the variance σ², sampled at the rate f, a low-pass filter of the band B passes σ² 2 B / f.
    """
    low_hz, high_hz = BANDS_HZ
    quiet_hz = 0.5 * rate_hz * (PASSED_C / noise_c) ** 2 if noise_c > 0.0 else high_hz
    return min(max(quiet_hz, low_hz), high_hz, 0.1 * rate_hz)
