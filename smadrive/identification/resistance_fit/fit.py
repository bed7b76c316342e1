"""The resistance of a wire as a function of temperature and phase, fitted to a recorded excitation.

    U/I = (1 - e ξ)² [(1 - ξ) f(T) + ξ g(T)] - τ dR/dt + noise / I

U and I are voltage and current, T is the temperature and ξ the phase, f and g are the resistances of martensite and
austenite, e is the contraction, R the resistance and τ a delay (see wire/identified_resistance.py). The equation is
linear in the parameters of f and g for a given e. So the fit is a weighted linear least-squares problem inside a search
for e (variable projection; Golub and Pereyra, SIAM J. Numer. Anal. 10, 1973). The noise of U/I is inversely
proportional to the current, so the weight of a sample is its current. The nodes of g are as close as an R-phase needs.
Penalties on the bends of g draw g to a straight line.

The contraction has a small effect, so the fit ties it to the contraction of usual actuator wire. The weight of the
penalties on the bends is chosen by generalised cross-validation (Golub, Heath and Wahba, Technometrics 21, 1979): a
wire without an R-phase gets an almost straight g, which has a smaller standard error.

U/I may be older than the readings of the sensors by a delay τ. The first fit has no τ and gives dR/dt. The second fit
has τ as a further parameter, with the column -dR/dt.

The fit uses the temperature of the wire, not the reading of the thermocouple, and the measured displacement.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt

import numpy as np

from smadrive.errors import IdentificationError, ModelError
from smadrive.identification.excitation import ExcitationRecord
from smadrive.identification.resistance_fit.design import (
    LinearFit,
    ResistanceDesign,
    ResistanceSamples,
    fitted,
    resistance_design,
)
from smadrive.numerics.arrays import FloatArray
from smadrive.numerics.residuals import MEDIAN_SHARE, neighbour_correlation, quantum, samples_per_independent
from smadrive.wire.identified_resistance import WireResistance, spline_design
from smadrive.wire.observability import resolution_error
from smadrive.wire.wire_model import WireModel

FIT = "resistance fit"
"""The attribute `where` of the errors that this file raises."""

RATE_SAMPLES = 3
"""The rate of the resistance at a sample is a difference over this number of samples before and after this sample."""

MIN_CURRENT_FRACTION, MIN_SAMPLES = 0.1, 200
"""Only samples with more than this fraction of the largest current are used; at least MIN_SAMPLES are needed."""

OUTLIER = 5.0
"""Samples whose residual exceeds this number of standard deviations are left out.

Their current changed during the measurement.
"""

LEAST_CHANGE = 10.0
"""The change of the resistance over the stroke must be at least this number of standard errors."""

MOST_NOISE = 0.2
"""Largest noise of the displacement that the resistance of one sample gives, as a share of the stroke."""

MOST_MISFIT = 0.03
"""Largest error of the fit that neighbouring samples share, as a share of the stroke: it does not average out.

Coarse meters make such an error, too: up to their resolution it is no reason to distrust the fit.
"""

SAME_TIME = "check that current and voltage are measured at the same time as temperature and displacement"


@dataclass(frozen=True)
class ResistanceFit:
    """A fitted resistance.

    resistance       the resistance as a function of temperature and phase
    within           half-widths of the 95 % intervals of martensite_ohm (Ω), martensite_ohm_per_k (Ω/K) and change
    change           relative change of the resistance from phase 0 to phase 1, at the median temperature of the samples
    rms_ohm          RMS of the residual, Ω
    noise_phase      noise of the phase of one sample, at the median current
    resolution       largest error of the phase by the resolution of current and voltage; see wire/observability.py
    temperature_c, phase, ohm   the samples, each (samples,)
    """

    resistance: WireResistance
    within: dict[str, float]
    change: float
    rms_ohm: float
    noise_phase: float
    resolution: float
    temperature_c: FloatArray
    phase: FloatArray
    ohm: FloatArray


def identify_resistance(record: ExcitationRecord, temperature_c: FloatArray, wire: WireModel) -> ResistanceFit:
    """Fit the resistance to a record whose wire had the temperatures `temperature_c`, °C.

    `wire` gives the travel. IdentificationError for a record without current or voltage, for fewer than `MIN_SAMPLES`
    samples with current, for a wire whose resistance hardly changes with the displacement, and for a resistance that
    does not follow from temperature and displacement.
    """
    samples = _samples(record, temperature_c, wire)
    reference_c = float(np.mean(samples.temperature_c))
    _, rough = fitted(resistance_design(samples, reference_c))
    design = resistance_design(_refined(samples, rough), reference_c)
    strain, linear = fitted(design)
    degrees = linear.residual_v.size - linear.freedom
    noise_v = float(np.sqrt(np.sum(linear.residual_v**2) / degrees))
    covariance = noise_v**2 * samples_per_independent(linear.residual_v) * linear.inverse
    leverage = np.einsum("ij,jk,ik->i", linear.matrix, covariance, linear.matrix)
    martensite, slope, delay_s, *austenite = linear.parameters.tolist()
    error_ohm = float(np.sqrt(np.mean(leverage)))
    nodes = tuple(design.nodes.tolist())
    try:
        resistance = WireResistance(
            reference_c, martensite, slope, strain, noise_v, error_ohm, delay_s, nodes, tuple(austenite)
        )
    except ModelError as error:
        raise IdentificationError(
            f"no wire has the fitted resistance ({error.where})",
            where=FIT,
            value=error.value,
            limit=error.limit,
            cure=SAME_TIME,
        ) from error
    quanta = (quantum(np.unique(column)) for column in (record.current_a, record.voltage_v))
    resolution = resolution_error(wire, resistance, *quanta)
    fit = _judged(resistance, design, covariance, linear.residual_v, resolution)
    _check_misfit(fit, linear.residual_v)
    return fit


def _samples(record: ExcitationRecord, temperature_c: FloatArray, wire: WireModel) -> ResistanceSamples:
    current = record.current_a
    if not np.any(current > 0.0) or not np.any(record.voltage_v > 0.0):
        raise IdentificationError(
            "the record has no current or no voltage, so the resistance is unknown",
            where=FIT,
            value=f"at most {current.max():g} A and {record.voltage_v.max():g} V",
            cure="record the excitation with a device that measures both",
        )
    used = (current > MIN_CURRENT_FRACTION * current.max()) & (record.voltage_v > 0.0)
    if np.count_nonzero(used) < MIN_SAMPLES:
        what = "too few samples with current"
        raise IdentificationError(
            what, where=FIT, value=int(np.count_nonzero(used)), limit=MIN_SAMPLES, cure="record a longer excitation"
        )
    phase = wire.phase_at(record.displacement_mm)
    ohm = record.voltage_v[used] / current[used]
    time_s, no_rate = record.time_s[used], np.zeros(ohm.size)
    return ResistanceSamples(time_s, temperature_c[used], phase[used], ohm, current[used], no_rate)


def _refined(samples: ResistanceSamples, rough: LinearFit) -> ResistanceSamples:
    """Return the samples without outliers, with the rate of the resistance by the first fit."""
    large = OUTLIER * float(np.median(np.abs(rough.residual_v))) / MEDIAN_SHARE
    good = np.abs(rough.residual_v) <= large
    ohm, many, last = rough.matrix @ rough.parameters, RATE_SAMPLES, samples.ohm.size - 1
    before, after = np.maximum(np.arange(last + 1) - many, 0), np.minimum(np.arange(last + 1) + many, last)
    rate = (ohm[after] - ohm[before]) / (samples.time_s[after] - samples.time_s[before])
    return ResistanceSamples(*(column[good] for column in samples._replace(rate=rate)))


def _judged(
    resistance: WireResistance,
    design: ResistanceDesign,
    covariance: FloatArray,
    residual_v: FloatArray,
    resolution: float,
) -> ResistanceFit:
    """Return the fit with its intervals.

    IdentificationError if the resistance determines the displacement too poorly.
    """
    samples = design.samples
    middle_c = float(np.median(samples.temperature_c))
    ends = resistance.ohm(middle_c, 0.0), resistance.ohm(middle_c, 1.0)
    warmer_k = middle_c - resistance.reference_c
    of_change = np.concatenate(
        ([-1.0, -warmer_k, 0.0], (1.0 - resistance.strain) ** 2 * spline_design(np.array([middle_c]), design.nodes)[0])
    )
    error_ohm = float(np.sqrt(of_change @ covariance @ of_change))
    slope = abs(resistance.ohm_per_phase(middle_c, 0.5))
    noise_phase = resistance.noise_v / float(np.median(samples.current_a)) / max(slope, 1e-12)
    if abs(ends[1] - ends[0]) < LEAST_CHANGE * error_ohm or noise_phase > MOST_NOISE:
        raise IdentificationError(
            "the resistance of this wire hardly changes with the displacement, and cannot replace a sensor",
            where=FIT,
            value=f"{ends[1] - ends[0]:+.2g} Ω over the stroke, ±{1.96 * error_ohm:.1g} Ω",
            limit=f"noise of one sample at most {100 * MOST_NOISE:g} % of the stroke, here {100 * noise_phase:.0f} %",
            cure="keep the displacement sensor, or measure current and voltage more finely",
        )
    spread = 1.96 * np.sqrt(np.diag(covariance))
    within = {
        "martensite_ohm": float(spread[0]),
        "martensite_ohm_per_k": float(spread[1]),
        "change": 1.96 * error_ohm / ends[0],
    }
    rms_ohm = float(np.sqrt(np.mean((residual_v / samples.current_a) ** 2)))
    change, columns = ends[1] / ends[0] - 1.0, (samples.temperature_c, samples.phase, samples.ohm)
    return ResistanceFit(resistance, within, change, rms_ohm, noise_phase, resolution, *columns)


def _check_misfit(fit: ResistanceFit, residual_v: FloatArray) -> None:
    """Raise IdentificationError if the resistance does not follow from temperature and displacement."""
    misfit = fit.noise_phase * sqrt(max(neighbour_correlation(residual_v), 0.0))
    most = max(MOST_MISFIT, fit.resolution)
    if misfit > most:
        raise IdentificationError(
            "the resistance does not follow from temperature and displacement",
            where=FIT,
            value=f"{100 * misfit:.1f} % of the stroke apart from noise",
            limit=f"{100 * most:.2g} %",
            cure=SAME_TIME,
        )
