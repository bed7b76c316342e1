"""The heat balance of a wire, fitted to a recorded excitation.

The record contains the electrical power P = U I, the thermocouple reading T_tc and the phase w (the displacement,
scaled to its span). With P(t) and w(t) given, the heat balance is linear,

    m c dT/dt = P - Q dw/dt - h A (T - T_a),     lag dT_tc/dt = T - T_tc,

with the wire temperature T, heat capacity m c, latent heat Q, heat loss h A and ambient temperature T_a. So the reading
can be simulated exactly (simulation.py). The fit finds the parameters (m c, h A, Q, T_a, lag) with the smallest
error of the reading, and never differentiates a noisy signal. A separate linear fit of U/I gives the resistance R(w).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy

from smadrive.errors import IdentificationError
from smadrive.identification.excitation import ExcitationRecord
from smadrive.identification.thermal_fit.simulation import NAMES, Samples, parameters_of, simulate, wire_temperature_c
from smadrive.numerics.arrays import FloatArray
from smadrive.numerics.residuals import noise_deviation, samples_per_independent
from smadrive.wire.heat_balance import HeatBalance

MIN_CURRENT_FRACTION = 0.2
"""The resistance is fitted to samples with more than this fraction of the largest current; others are mostly noise."""

FIT = "thermal fit"
"""The attribute `where` of the errors that this file raises."""

MIN_SAMPLES, MIN_HEATED_SAMPLES = 200, 20
MOVES = 8.0
"""Smallest span of the displacement of a moving wire, in standard deviations of its steps. White noise spans 3.6."""

SYSTEMATIC = 0.005
"""Relative systematic error of the fit, from the sampling and the lumped model; found on simulated wires."""
UNCERTAIN = {"heat_capacity_j_per_k": 0.1, "loss_w_per_k": 0.1, "latent_heat_j": 0.3}
"""Largest allowed half of the 95 % interval, as a share of each parameter that the feedforward uses."""


@dataclass(frozen=True)
class ThermalFit:
    """A fitted heat balance.

    balance              the heat balance
    wire_temperature_c   temperature of the wire at the samples, without lag and almost without noise
    within               half of the 95 % interval of each parameter, by its name in HeatBalance. It is relative to the
                         parameter, but absolute for ambient_c (in K) and resistance_change
    """

    balance: HeatBalance
    wire_temperature_c: FloatArray
    within: dict[str, float]


def identify_thermal(record: ExcitationRecord, start: HeatBalance) -> ThermalFit:
    """Fit the heat balance to one recorded excitation, and measure the noise of the thermocouple.

    The search begins at the nominal heat balance `start`. It keeps each parameter within a factor of 5 of its nominal
    value, and ambient_c within 16 K. IdentificationError for an unusable record (too short, unsorted, no heating, no
    movement), and for a parameter that ends at its bound or has too large an interval.
    """
    _check_excited(record)
    phase = _phase(record.displacement_mm, record.temperature_c)
    grid, samples = _uniform(record, phase)
    balance, within = _fit_balance(samples, start)
    balance, within_resistance = _fit_resistance(record, phase, balance)
    noise_c = noise_deviation(record.temperature_c, order=3)
    balance, within = replace(balance, thermocouple_noise_c=noise_c), within | within_resistance
    _check_intervals(within)
    wire = wire_temperature_c(samples, balance)
    return ThermalFit(balance, np.interp(record.time_s, grid, wire), within)


def _check_excited(record: ExcitationRecord) -> None:
    time = record.time_s
    if time.size < MIN_SAMPLES:
        raise IdentificationError(
            "too few samples", where=FIT, value=time.size, limit=MIN_SAMPLES, cure="record a longer excitation"
        )
    if not np.all(np.diff(time) > 0):
        raise IdentificationError("time_s does not increase everywhere", where=FIT, cure="sort the samples by time")
    if record.current_a.max() <= 0:
        raise IdentificationError("the current is always zero", where=FIT, cure="record an excitation that heats")


def _phase(displacement: FloatArray, reading: FloatArray) -> FloatArray:
    """Return the displacement scaled to [0, 1], so that it rises on heating for either sign of the sensor."""
    low, high = np.percentile(displacement, [0.5, 99.5])
    if high - low <= MOVES * np.std(np.diff(displacement)):
        raise IdentificationError(
            f"the wire did not move between {reading.min():.0f} and {reading.max():.0f} °C",
            where=FIT,
            value=f"displacement span {high - low:.2g} mm",
            cure="heat the wire through its transformation (excitation.high_c), and check the sensor",
        )
    rising = np.corrcoef(displacement, reading)[0, 1] >= 0
    phase: FloatArray = np.clip((displacement - low) / (high - low), 0.0, 1.0)
    return phase if rising else 1.0 - phase


def _uniform(record: ExcitationRecord, phase: FloatArray) -> tuple[FloatArray, Samples]:
    """Return a time grid, and the samples interpolated to it. The power follows from the interpolated energy."""
    time = record.time_s
    dt_s = float(np.median(np.diff(time)))
    grid = np.arange(time[0], time[-1] + 0.5 * dt_s, dt_s)
    power = record.current_a * record.voltage_v
    energy = np.concatenate(([0.0], np.cumsum(power[1:] * np.diff(time))))
    mean_power = np.diff(np.interp(grid, time, energy), prepend=0.0) / dt_s
    samples = Samples(dt_s, mean_power, np.interp(grid, time, record.temperature_c), np.interp(grid, time, phase))
    return grid, samples


def _check_intervals(within: dict[str, float]) -> None:
    """Raise IdentificationError when the interval of a parameter is larger than `UNCERTAIN` allows."""
    for name, plain in NAMES.items():
        if within[name] > UNCERTAIN.get(name, np.inf):
            raise IdentificationError(
                f"the record does not determine the {plain} well enough",
                where=FIT,
                value=f"±{100.0 * within[name]:.3g} %",
                limit=f"±{100.0 * UNCERTAIN[name]:.3g} %",
                cure="excite for longer, over the whole transformation, and with a quieter thermocouple",
            )


def _intervals(jacobian: FloatArray, residual: FloatArray) -> FloatArray:
    """Return half of the 95 % interval of each unknown. Correlated residuals count as fewer samples."""
    variance = float(np.mean(residual**2)) * samples_per_independent(residual)
    return np.asarray(1.96 * np.sqrt(variance * np.diag(np.linalg.pinv(jacobian.T @ jacobian))), dtype=np.float64)


def _fit_balance(samples: Samples, start: HeatBalance) -> tuple[HeatBalance, dict[str, float]]:
    nominal = parameters_of(start)
    nominal[[2, 4]] = np.maximum(nominal[[2, 4]], [1e-3 * start.heat_capacity_j_per_k, samples.dt_s])
    positive = np.array([True, True, True, False, True])

    def parameters(x: FloatArray) -> FloatArray:
        return np.where(positive, nominal * np.exp(np.where(positive, x, 0.0)), nominal + 10.0 * x)

    def residual(x: FloatArray) -> FloatArray:
        return simulate(samples, parameters(x))[1] - samples.reading_c

    bound = np.log(5.0)
    fit = scipy.optimize.least_squares(
        residual, np.zeros(5), bounds=(-bound, bound), x_scale="jac", loss="soft_l1", f_scale=1.0
    )
    for name, value in zip(NAMES.values(), fit.x, strict=True):
        if abs(value) > 0.99 * bound:
            raise IdentificationError(
                f"the fitted {name} is at the limit of its search range around the nominal value",
                where=FIT,
                cure="check the wire file, the contact of the thermocouple, and that the record heats and cools",
            )
    capacity, loss, latent, ambient, lag = parameters(fit.x).tolist()
    found = HeatBalance(capacity, loss, latent, ambient, start.resistance_cold_ohm, start.resistance_change, lag)
    left = residual(fit.x)
    half = np.hypot(_intervals(np.asarray(fit.jac), left), SYSTEMATIC) * np.where(positive, 1.0, 10.0)
    return found, dict(zip(NAMES, half.tolist(), strict=True))


def _fit_resistance(
    record: ExcitationRecord, phase: FloatArray, balance: HeatBalance
) -> tuple[HeatBalance, dict[str, float]]:
    """Fit R_cold and r of R = R_cold (1 + r w), weighted by the current.

    Return `balance` with these two parameters, and half of their 95 % intervals.
    """
    current = record.current_a
    heated = current > MIN_CURRENT_FRACTION * current.max()
    if np.count_nonzero(heated) < MIN_HEATED_SAMPLES:
        what = "too few samples with current to fit the resistance"
        raise IdentificationError(what, where=FIT, limit=MIN_HEATED_SAMPLES, cure="record a longer excitation")
    ohm = record.voltage_v[heated] / current[heated]
    (slope, cold), covariance = np.polyfit(phase[heated], ohm, 1, w=current[heated], cov=True)
    left_v = (ohm - cold - slope * phase[heated]) * current[heated]
    slope_ohm, cold_ohm = (1.96 * np.sqrt(samples_per_independent(left_v) * np.diag(covariance))).tolist()
    found = replace(balance, resistance_cold_ohm=float(cold), resistance_change=float(slope / cold))
    return found, {
        "resistance_cold_ohm": float(np.hypot(cold_ohm / cold, SYSTEMATIC)),
        "resistance_change": float(np.hypot(slope_ohm / cold, SYSTEMATIC)),
    }
