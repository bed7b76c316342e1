"""The resistance of a wire as a function of temperature and phase, fitted to a recorded excitation.

    U/I = (1 - e ξ)² [(1 - ξ) f(T) + ξ g(T)] - τ dR/dt + noise / I

The equation is linear in the parameters of f and g for a given contraction e (see wire/resistance.py). So the fit is a
weighted linear least-squares problem inside a search for e (variable projection; Golub and Pereyra, SIAM J. Numer.
Anal. 10, 1973). The noise of U/I falls with the current, so the weight of a sample is its current. The nodes of g are
as close as an R-phase needs. Penalties on the bends of g draw g to a straight line.

The contraction has a small effect, so the fit ties it to that of usual actuator wire. The strength of the straight line
is chosen by generalised cross-validation (Golub, Heath and Wahba, Technometrics 21, 1979): a wire without an R-phase
gets an almost straight g, which has a smaller standard error.

U/I may be older than the readings of the sensors by a delay τ. The first fit gives dR/dt, and the second one has the
further parameter τ, with the column -dR/dt.

The fit uses the temperature of the wire, not the reading of the thermocouple, and the measured displacement.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from smadrive.errors import IdentificationError
from smadrive.identification.excitation import ExcitationRecord
from smadrive.wire.resistance import LEAST_NODES, WireResistance, spline_design
from smadrive.wire.wire_model import WireModel

Array = NDArray[np.float64]

FIT = "resistance fit"
"""The part `where` of the errors in this file."""

NODE_C = 4.0
"""Distance of the nodes of g, K. An R-phase changes the resistance within about 10 K."""

BENDS = (3e-4, 1e-2)
"""Expected second differences of g at its nodes, as shares of the resistance. An R-phase of 5 % needs 0.01."""

RATE_SAMPLES = 3
"""The rate of the resistance is a difference over this number of samples, on each side."""

MIN_CURRENT_FRACTION, MIN_SAMPLES = 0.1, 200
"""Only samples with more than this fraction of the largest current are used, and at least this number is needed."""

OUTLIER = 5.0
"""Samples with a larger residual, in standard deviations, are left out: the current changed while it was measured."""

STRAIN, STRAIN_SPREAD, MOST_STRAIN = 0.04, 0.01, 0.1
"""Contraction of usual actuator wire over its stroke, its standard deviation, and the largest possible contraction."""

LEAST_CHANGE = 10.0
"""The change of the resistance over the stroke must be at least this number of standard errors."""

MOST_NOISE = 0.2
"""The noise of one sample, as a share of the stroke, with which the resistance is still of use."""


@dataclass(frozen=True)
class ResistanceFit:
    """A fitted resistance.

    resistance       the resistance as a function of temperature and phase
    within           half of the 95 % interval of martensite_ohm (Ω), martensite_ohm_per_k (Ω/K) and change
    change           relative change from the cold to the hot wire at one temperature, in the middle of the loop
    rms_ohm          RMS of the residual, Ω
    noise_phase      noise of the phase of one sample, at the median current
    """

    resistance: WireResistance
    within: dict[str, float]
    change: float
    rms_ohm: float
    noise_phase: float


class _Samples(NamedTuple):
    """The samples of the fit, each (samples,). `rate` is dR/dt, Ω/s, or 0 before the first fit."""

    time_s: Array
    temperature_c: Array
    phase: Array
    ohm: Array
    current_a: Array
    rate: Array


class _Design(NamedTuple):
    """The linear problem for any contraction: samples, nodes of g, their matrix (samples, nodes), and the penalty.

    `warmer_k` is the temperature above the reference temperature. `penalty` is (parameters, parameters), for bends of
    1 Ω and a noise of 1 V.
    """

    samples: _Samples
    nodes: Array
    spline: Array
    warmer_k: Array
    penalty: Array


class _Linear(NamedTuple):
    """The solution of the linear problem for one contraction and one penalty.

    `residual_v` is weighted with the current. `inverse` is the inverse of the normal matrix. `matrix` maps the
    parameters to the resistances. `freedom` is the number of parameters that the penalty leaves free. `cost_v2` is the
    sum of squares, with that of the tied contraction.
    """

    parameters: Array
    residual_v: Array
    inverse: Array
    matrix: Array
    freedom: float
    cost_v2: float

    @property
    def cross_validation(self) -> float:
        """The criterion of the generalised cross-validation; smaller is better."""
        return float(np.sum(self.residual_v**2)) / (self.residual_v.size - self.freedom) ** 2


def identify_resistance(record: ExcitationRecord, temperature_c: Array, wire: WireModel) -> ResistanceFit:
    """Fit the resistance to a record whose wire had the temperatures `temperature_c`, °C.

    `wire` gives the travel. IdentificationError for a record without current or voltage, and for a wire whose
    resistance hardly changes with the displacement.
    """
    samples = _samples(record, temperature_c, wire)
    reference_c = float(np.mean(samples.temperature_c))
    _, rough = _fitted(_design(samples, reference_c))
    design = _design(_refined(samples, rough), reference_c)
    strain, linear = _fitted(design)
    degrees = linear.residual_v.size - linear.freedom
    noise_v = float(np.sqrt(np.sum(linear.residual_v**2) / degrees))
    covariance = noise_v**2 * _fewer(linear.residual_v) * linear.inverse
    leverage = np.einsum("ij,jk,ik->i", linear.matrix, covariance, linear.matrix)
    martensite, slope, delay_s, *austenite = linear.parameters.tolist()
    error_ohm = float(np.sqrt(np.mean(leverage)))
    nodes = tuple(design.nodes.tolist())
    resistance = WireResistance(
        reference_c, martensite, slope, strain, noise_v, error_ohm, delay_s, nodes, tuple(austenite)
    )
    return _judged(resistance, design, covariance, linear.residual_v)


def _samples(record: ExcitationRecord, temperature_c: Array, wire: WireModel) -> _Samples:
    current = record.current_a
    if not np.any(current > 0.0) or not np.any(record.voltage_v > 0.0):
        raise IdentificationError(
            "the record has no current or no voltage, so the resistance is unknown",
            where=FIT,
            cure="record the excitation with a device that measures both",
        )
    used = (current > MIN_CURRENT_FRACTION * current.max()) & (record.voltage_v > 0.0)
    if np.count_nonzero(used) < MIN_SAMPLES:
        what = "too few samples with current"
        raise IdentificationError(
            what, where=FIT, value=int(np.count_nonzero(used)), limit=MIN_SAMPLES, cure="record a longer excitation"
        )
    phase = (record.displacement_mm - wire.cold_mm) / wire.travel_mm
    ohm = record.voltage_v[used] / current[used]
    return _Samples(record.time_s[used], temperature_c[used], phase[used], ohm, current[used], np.zeros(ohm.size))


def _refined(samples: _Samples, rough: _Linear) -> _Samples:
    """Return the samples without outliers, with the rate of the resistance by the first fit."""
    large = OUTLIER * float(np.median(np.abs(rough.residual_v))) / 0.6745
    good = np.abs(rough.residual_v) <= large
    fitted, many, last = rough.matrix @ rough.parameters, RATE_SAMPLES, samples.ohm.size - 1
    before, after = np.maximum(np.arange(last + 1) - many, 0), np.minimum(np.arange(last + 1) + many, last)
    rate = (fitted[after] - fitted[before]) / (samples.time_s[after] - samples.time_s[before])
    return _Samples(*(column[good] for column in samples._replace(rate=rate)))


def _design(samples: _Samples, reference_c: float) -> _Design:
    low, high = float(samples.temperature_c.min()), float(samples.temperature_c.max())
    nodes = np.linspace(low, high, max(LEAST_NODES, round((high - low) / NODE_C) + 1))
    bends = np.zeros((nodes.size - 2, 3 + nodes.size))
    bends[:, 3:] = np.diff(np.eye(nodes.size), 2, axis=0)
    spline = spline_design(samples.temperature_c, nodes)
    return _Design(samples, nodes, spline, samples.temperature_c - reference_c, bends.T @ bends)


def _fitted(design: _Design) -> tuple[float, _Linear]:
    """Return contraction and solution, with the penalty of the smallest cross-validation."""
    samples = design.samples
    noise_v = _coarse_noise_v(samples.ohm * samples.current_a)
    penalties = [(noise_v / (bend * float(np.median(samples.ohm)))) ** 2 for bend in BENDS]
    fits = []
    for penalty in penalties:
        strain = _strain(design, penalty, noise_v)
        fits.append((strain, _solved(design, strain, penalty, noise_v)))
    return min(fits, key=lambda fit: fit[1].cross_validation)


def _strain(design: _Design, penalty: float, noise_v: float) -> float:
    """Return the contraction e with the smallest cost."""

    def cost_v2(strain: float) -> float:
        return _solved(design, strain, penalty, noise_v).cost_v2

    return float(minimize_scalar(cost_v2, bounds=(0.0, MOST_STRAIN), method="bounded", options={"xatol": 1e-3}).x)


def _solved(design: _Design, strain: float, penalty: float, noise_v: float) -> _Linear:
    """Solve the linear problem for one contraction. The residual is weighted with the current, so it is a voltage."""
    samples = design.samples
    geometry = (1.0 - strain * samples.phase) ** 2
    martensite, austenite = geometry * (1.0 - samples.phase), geometry * samples.phase
    columns = martensite, martensite * design.warmer_k, -samples.rate, austenite[:, None] * design.spline
    matrix = np.column_stack(columns)
    weighted, target = matrix * samples.current_a[:, None], samples.ohm * samples.current_a
    data = weighted.T @ weighted
    inverse = np.linalg.pinv(data + penalty * design.penalty, hermitian=True)
    parameters = inverse @ (weighted.T @ target)
    residual_v = target - weighted @ parameters
    bent_v2 = penalty * float(parameters @ design.penalty @ parameters)
    tied_v2 = (noise_v * (strain - STRAIN) / STRAIN_SPREAD) ** 2
    freedom = float(np.trace(inverse @ data))
    return _Linear(parameters, residual_v, inverse, matrix, freedom, float(residual_v @ residual_v) + bent_v2 + tied_v2)


def _coarse_noise_v(voltage_v: Array) -> float:
    """Return the noise of the voltage, from its second differences. It sets the strength of the penalties."""
    return float(np.median(np.abs(np.diff(voltage_v, 2))) / 0.6745 / np.sqrt(6.0)) + 1e-6


def _fewer(residual: Array) -> float:
    """Return the factor of the variances by correlated residuals, which count as fewer samples."""
    correlation = float(np.clip(np.corrcoef(residual[:-1], residual[1:])[0, 1], 0.0, 0.99))
    return (1.0 + correlation) / (1.0 - correlation)


def _judged(resistance: WireResistance, design: _Design, covariance: Array, residual_v: Array) -> ResistanceFit:
    """Return the fit with its intervals. IdentificationError if the resistance says too little of the displacement."""
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
    return ResistanceFit(resistance, within, ends[1] / ends[0] - 1.0, rms_ohm, noise_phase)
