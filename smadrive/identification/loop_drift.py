"""The shift of the loop of a wire since its identification, estimated from the samples of one run.

The displacement y of a run depends on four parameters x = (d₊, d₋, s, z): the shifts of the heating and of the cooling
branch in K, the relative change of the stroke, and the shift of the zero as a share of the stroke:

    y(x) = y₀ + (y_model(v; branches at μ₊ + d₊ and μ₋ + d₋) - y₀) (1 + s) + z |S|     e = y - y(0) ≈ J x      J = ∂y/∂x

y₀ and S are the offset and the scale of the model. A run visits only a part of the loop, and does not determine every
direction of x. So the least-squares estimate of x uses a prior: the covariance P of the likely changes of a wire. C is
the covariance of the estimate:

    C = (JᵀJ / r + P⁻¹)⁻¹        x = C Jᵀe / r        r = variance of the residual · (1 + ρ)/(1 - ρ)

ρ is the correlation of neighbouring residuals: n correlated samples count as n (1 - ρ)/(1 + ρ) independent ones. The
input v is the temperature of the wire, computed from the thermocouple without the heat balance. A polynomial smooths
the reading, and its slope corrects the lag. So neither a draft nor a wrong heat balance looks like a moved loop.

The noise of the reading moves the turning points, and a wrong turning point makes the whole inner loop wrong. So the
standard errors also contain this noise: as a shift of the temperature in the errors of d₊ and d₋, and as the RMS change
of the displacement by this shift in the error of s, as a share of the visited travel. A run that does not reach the
ends of the travel extrapolates the stroke with the model, so the error of s also contains that of the model,
`MODEL_ERROR` of the visited travel. A dead band hides false reversals by the noise, and with them true ones that are as
small, for example those of a wire that is held. So the fit is repeated with a narrower dead band, and the standard
errors contain the change of the result.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import nan

import numpy as np
import scipy

from smadrive.errors import ModelError
from smadrive.hysteresis import IdentifiedModel
from smadrive.hysteresis.reversal import monotone_runs, turning_points
from smadrive.identification.adaptation.likely_changes import LikelyChanges
from smadrive.identification.reshape import BranchShape, reshaped, shape_of
from smadrive.numerics.arrays import FloatArray
from smadrive.numerics.residuals import samples_per_independent
from smadrive.wire.health.sensitivity import SHIFT

SMOOTHED_S = 0.5
"""The reading is smoothed over this time.

It is much longer than the lag of a thermocouple bead, and much shorter than a passage through the transformation.
"""

NOISES, NARROWER = 2.0, 1.2
"""Radius of the dead band against false reversals, and of the narrower one, in standard deviations of the reading.

The smoothing leaves about half of the noise of the reading.
"""

MOST_SAMPLES = 1500
"""A path with more samples is thinned out to this number. Its turning points stay."""

LEAST_TRAVEL = 0.1
"""A run whose measured travel is less than this share of the stroke does not show the loop."""

MOST_MISFIT = 3.0
"""Largest RMS difference of a run from its fitted loop, in % of the stroke.

A larger one has another cause than a moved loop: a bad sensor, or reversals that the noise of the thermocouple hides.
"""

MODEL_ERROR = 0.01
"""Error of the stroke by the shape of the identified branches, as a share. The runs of one wire differ by as much."""

ITERATIONS, SETTLED = 10, 0.005
"""Largest number of linearisations. The fit ends when no shift, in K, and no share changes by more than `SETTLED`.

A single linearisation, at the identified loop, would find half of a shift of twice the width of a branch.
"""

FAR_C, APART_C = 20.0, 2.0
"""The fit begins at the best common shift of both branches, from -`FAR_C` to `FAR_C` in steps of `APART_C`, K."""

DIFFERENCE_C = 0.5


@dataclass(frozen=True, slots=True)
class LoopDrift:
    """The drift of the loop of a wire in one run, and its standard errors.

    heating_k, cooling_k   shifts of the heating and of the cooling branch since the identification, K
    stroke_share           change of the stroke, as a share
    errors                 standard errors of heating_k, cooling_k and stroke_share
    model_percent          RMS error of the unchanged model in this run, in % of the stroke
    """

    heating_k: float
    cooling_k: float
    stroke_share: float
    errors: tuple[float, float, float]
    model_percent: float


UNKNOWN = LoopDrift(nan, nan, nan, (nan, nan, nan), nan)
"""The result of a run that does not show the loop."""


def wire_temperature_c(time_s: FloatArray, reading_c: FloatArray, lag_s: float) -> FloatArray:
    """Return the temperature of the wire in °C at the times `time_s` (samples,), from the reading of its thermocouple.

    `lag_s` is the lag of the thermocouple. The reading must be finite, and `time_s` must increase.
    """
    dt_s = float(np.median(np.diff(time_s)))
    samples = max(int(SMOOTHED_S / dt_s) // 2 * 2 + 1, 5)
    if len(time_s) <= samples:
        return reading_c
    grid_s = np.arange(time_s[0], time_s[-1] + 0.5 * dt_s, dt_s)
    even_c = np.interp(grid_s, time_s, reading_c)
    smooth_c, slope = (scipy.signal.savgol_filter(even_c, samples, 2, deriv=n, delta=dt_s) for n in (0, 1))
    return np.interp(time_s, grid_s, smooth_c + lag_s * slope)


def fit_loop_drift(
    model: IdentifiedModel, wire_c: FloatArray, displacement_mm: FloatArray, noise_c: float
) -> LoopDrift:
    """Return the drift of the loop of a wire, from the temperatures `wire_c` and the displacements of one run.

    `wire_c` and `displacement_mm` have the shape (samples,). `noise_c` is the noise of the thermocouple, K. `model` is
    the model from the identification. The result is `UNKNOWN` for a run that does not show the loop. If no moved loop
    describes the run, only `model_percent` is known.
    """
    path_c, moved_mm = _path(wire_c, displacement_mm, NOISES * noise_c)
    stroke_mm, shape = abs(model.scale), shape_of(model)
    predicted_mm = model.simulate(path_c, float(moved_mm[0]))
    visited, predicted = (min(float(np.ptp(one_mm)) / stroke_mm, 1.0) for one_mm in (moved_mm, predicted_mm))
    if max(visited, predicted) < LEAST_TRAVEL:
        return UNKNOWN
    model_percent = _misfit_percent(model, shape, np.zeros(4), path_c, moved_mm)
    only_percent = replace(UNKNOWN, model_percent=model_percent)
    if visited < LEAST_TRAVEL:  # a sensor that is stuck, or a loop that has moved beyond the temperatures of the run
        return only_percent
    try:
        found = _fitted(model, shape, path_c, moved_mm)
        narrower = _fitted(model, shape, *_path(wire_c, displacement_mm, NARROWER * noise_c))
        if found is None or narrower is None:
            return only_percent
        (drift, covariance), (other, _) = found, narrower
        if _misfit_percent(model, shape, drift, path_c, moved_mm) > MOST_MISFIT:
            return only_percent
    except ModelError:  # no model of the wire has the shape of this loop
        return only_percent
    heating_k, cooling_k, share, _ = drift.tolist()
    scale_error = float(np.hypot(SHIFT * noise_c / min(shape.sigma_heating, shape.sigma_cooling), MODEL_ERROR))
    systematic = np.array([noise_c, noise_c, scale_error / visited])
    errors = np.sqrt(np.diag(covariance)[:3] + (drift - other)[:3] ** 2 + systematic**2).tolist()
    return LoopDrift(heating_k, cooling_k, share, (errors[0], errors[1], errors[2]), model_percent)


def _fitted(
    model: IdentifiedModel, before: BranchShape, path_c: FloatArray, moved_mm: FloatArray
) -> tuple[FloatArray, FloatArray] | None:
    """Return the estimate of x, and its covariance C; None if the fit does not settle.

    `before` is the shape of `model`.
    """
    likely = LikelyChanges()
    prior = np.diag(np.array([likely.drift_c, likely.drift_c, likely.drift, likely.drift]) ** -2.0)
    start_mm, stroke_mm = float(moved_mm[0]), abs(model.scale)
    drift = _nearest_shift(model, path_c, moved_mm)
    for _ in range(ITERATIONS):
        base_mm, jacobian = _linearized(model, before, drift, path_c, start_mm)
        previous, error = drift, (moved_mm - base_mm) / stroke_mm
        drift, covariance = _estimate(jacobian, error + jacobian @ drift, prior)
        if float(np.abs(drift - previous).max()) <= SETTLED:
            return drift, covariance
    return None


def _nearest_shift(model: IdentifiedModel, path_c: FloatArray, moved_mm: FloatArray) -> FloatArray:
    """Return x for the common shift of both branches with which the model is nearest to the displacements.

    With both branches shifted by k, the displacement at T is that of the unchanged model at T - k.
    """
    shifts_k, start_mm = np.arange(-FAR_C, FAR_C + APART_C, APART_C), float(moved_mm[0])
    errors_mm = [model.simulate(path_c - shift_k, start_mm) - moved_mm for shift_k in shifts_k]
    nearest_k = shifts_k[np.argmin([np.mean(error_mm**2) for error_mm in errors_mm])]
    return np.array([nearest_k, nearest_k, 0.0, 0.0])


def _misfit_percent(
    model: IdentifiedModel, before: BranchShape, drift: FloatArray, path_c: FloatArray, moved_mm: FloatArray
) -> float:
    """Return the RMS difference of the displacements from y(x) for x = `drift`, in % of the stroke."""
    error_mm = moved_mm - _moved_mm(model, before, drift, path_c, float(moved_mm[0]))
    return 100.0 * float(np.sqrt(np.mean(np.square(error_mm)))) / abs(model.scale)


def _path(wire_c: FloatArray, displacement_mm: FloatArray, radius: float) -> tuple[FloatArray, FloatArray]:
    """Return the temperatures without false reversals, and the displacements, thinned out to `MOST_SAMPLES`."""
    path_c = monotone_runs(wire_c, radius)
    kept = np.linspace(0, len(path_c) - 1, MOST_SAMPLES).round().astype(np.intp)
    kept = np.union1d(kept, turning_points(path_c, radius))
    return path_c[kept], displacement_mm[kept]


def _moved_mm(
    model: IdentifiedModel, before: BranchShape, drift: FloatArray, path_c: FloatArray, start_mm: float
) -> FloatArray:
    """Return y(x) in mm along the path for x = `drift`. `before` is the shape of `model`."""
    heating_k, cooling_k, share, zero = drift.tolist()
    shape = before._replace(mu_heating=before.mu_heating + heating_k, mu_cooling=before.mu_cooling + cooling_k)
    y = reshaped(model, shape).simulate(path_c, start_mm)
    return np.asarray(model.offset + (y - model.offset) * (1.0 + share) + zero * abs(model.scale))


def _linearized(
    model: IdentifiedModel, before: BranchShape, drift: FloatArray, path_c: FloatArray, start_mm: float
) -> tuple[FloatArray, FloatArray]:
    """Return y(x) at x = `drift` in mm, (samples,), and ∂y/∂x in strokes, (samples, 4)."""
    base = _moved_mm(model, before, drift, path_c, start_mm)
    columns = [
        (_moved_mm(model, before, drift + DIFFERENCE_C * np.eye(4)[n], path_c, start_mm) - base) / DIFFERENCE_C
        for n in (0, 1)
    ]
    stroke_mm = abs(model.scale)
    ones = np.ones_like(base)
    return base, np.column_stack([*(one / stroke_mm for one in columns), (base - model.offset) / stroke_mm, ones])


def _estimate(jacobian: FloatArray, error: FloatArray, prior: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the estimate of x and its covariance C. The variance of the residual comes from a fit without prior."""
    normal, slope = jacobian.T @ jacobian, jacobian.T @ error
    residual = error - jacobian @ np.linalg.solve(normal + 1e-9 * np.trace(normal) * np.eye(4), slope)
    variance = float(np.mean(residual**2)) * samples_per_independent(residual)
    covariance: FloatArray = np.asarray(np.linalg.inv(normal / variance + prior), np.float64)
    return covariance @ slope / variance, covariance
