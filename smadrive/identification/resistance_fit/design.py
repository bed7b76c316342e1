"""The linear problem of the resistance fit (fit.py), and its solution with a penalty and a search for the contraction.

For a given contraction e the resistance is linear in the parameters of f and g:

    minimise Σ I² (U/I - R)² + penalty · Σ (bends of g)² + (e - e_usual)² / σ_e² · σ_U²

I and U are current and voltage, and R is the resistance of the model. f and g are the resistances of martensite and
austenite. A bend is a second difference of g at its nodes. e_usual and σ_e are the contraction of usual wire and its
standard deviation (`STRAIN`, `STRAIN_SPREAD`), σ_U is the noise of the voltage.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy

from smadrive.numerics.arrays import FloatArray
from smadrive.numerics.residuals import noise_deviation
from smadrive.wire.identified_resistance import LEAST_NODES, spline_design

NODE_C = 4.0
"""Distance of the nodes of g, K. An R-phase changes the resistance within about 10 K."""

BENDS = (3e-4, 1e-2)
"""Expected second differences of g at its nodes, as shares of the resistance. An R-phase of 5 % needs 0.01.

One fit is made for each value, and the cross-validation chooses between them.
"""

STRAIN, STRAIN_SPREAD, MOST_STRAIN = 0.04, 0.01, 0.1
"""Contraction of usual actuator wire over its stroke, its standard deviation, and the largest possible contraction.

All three are shares of the length of the wire.
"""


class ResistanceSamples(NamedTuple):
    """The samples of the fit, each (samples,). `rate` is dR/dt, Ω/s, or 0 before the first fit."""

    time_s: FloatArray
    temperature_c: FloatArray
    phase: FloatArray
    ohm: FloatArray
    current_a: FloatArray
    rate: FloatArray


class ResistanceDesign(NamedTuple):
    """The linear problem for any contraction.

    samples    the samples of the fit
    nodes      temperatures of the nodes of g, °C
    spline     matrix that maps the values of g at the nodes to the samples, (samples, nodes)
    warmer_k   temperature of the samples above the reference temperature, K
    penalty    matrix of the sum of the squared bends of g, (parameters, parameters), for expected bends of 1 Ω and a
               noise of 1 V
    """

    samples: ResistanceSamples
    nodes: FloatArray
    spline: FloatArray
    warmer_k: FloatArray
    penalty: FloatArray


class LinearFit(NamedTuple):
    """The solution of the linear problem for one contraction and one penalty.

    parameters   of f: resistance (Ω) and slope (Ω/K); then the delay τ (s) and the values of g at its nodes (Ω)
    residual_v   residuals of the resistance, times the current, V
    inverse      inverse of the normal matrix
    matrix       matrix that maps the parameters to the resistances of the samples
    freedom      effective number of parameters that the penalty leaves free
    cost_v2      sum of the squared residuals and of the terms of the bends and of the contraction, V²
    """

    parameters: FloatArray
    residual_v: FloatArray
    inverse: FloatArray
    matrix: FloatArray
    freedom: float
    cost_v2: float

    @property
    def cross_validation(self) -> float:
        """The criterion of the generalised cross-validation; smaller is better."""
        return float(np.sum(self.residual_v**2)) / (self.residual_v.size - self.freedom) ** 2


def resistance_design(samples: ResistanceSamples, reference_c: float) -> ResistanceDesign:
    """Return the linear problem of the samples."""
    low, high = float(samples.temperature_c.min()), float(samples.temperature_c.max())
    nodes = np.linspace(low, high, max(LEAST_NODES, round((high - low) / NODE_C) + 1))
    bends = np.zeros((nodes.size - 2, 3 + nodes.size))
    bends[:, 3:] = np.diff(np.eye(nodes.size), 2, axis=0)
    spline = spline_design(samples.temperature_c, nodes)
    return ResistanceDesign(samples, nodes, spline, samples.temperature_c - reference_c, bends.T @ bends)


def fitted(design: ResistanceDesign) -> tuple[float, LinearFit]:
    """Return contraction and solution, for the penalty with the smallest criterion of cross-validation."""
    samples = design.samples
    noise_v = noise_deviation(samples.ohm * samples.current_a) + 1e-6  # it sets the strength of the penalties
    penalties = [(noise_v / (bend * float(np.median(samples.ohm)))) ** 2 for bend in BENDS]
    fits = []
    for penalty in penalties:
        strain = _strain(design, penalty, noise_v)
        fits.append((strain, _solved(design, strain, penalty, noise_v)))
    return min(fits, key=lambda fit: fit[1].cross_validation)


def _strain(design: ResistanceDesign, penalty: float, noise_v: float) -> float:
    """Return the contraction e with the smallest cost."""

    def cost_v2(strain: float) -> float:
        return _solved(design, strain, penalty, noise_v).cost_v2

    return float(
        scipy.optimize.minimize_scalar(cost_v2, bounds=(0.0, MOST_STRAIN), method="bounded", options={"xatol": 1e-3}).x
    )


def _solved(design: ResistanceDesign, strain: float, penalty: float, noise_v: float) -> LinearFit:
    """Solve the linear problem for one contraction. The residual is weighted with the current, so it is a voltage."""
    samples = design.samples
    geometry = (1.0 - strain * samples.phase) ** 2
    martensite, austenite = geometry * (1.0 - samples.phase), geometry * samples.phase
    columns = martensite, martensite * design.warmer_k, -samples.rate, austenite[:, None] * design.spline
    matrix = np.asarray(np.column_stack(columns), dtype=np.float64)
    weighted: FloatArray = matrix * samples.current_a[:, None]
    target = samples.ohm * samples.current_a
    data = weighted.T @ weighted
    inverse: FloatArray = np.asarray(np.linalg.pinv(data + penalty * design.penalty, hermitian=True), dtype=np.float64)
    parameters = inverse @ (weighted.T @ target)
    residual_v = target - weighted @ parameters
    bent_v2 = penalty * float(parameters @ design.penalty @ parameters)
    tied_v2 = (noise_v * (strain - STRAIN) / STRAIN_SPREAD) ** 2
    freedom = float(np.trace(inverse @ data))
    return LinearFit(
        parameters, residual_v, inverse, matrix, freedom, float(residual_v @ residual_v) + bent_v2 + tied_v2
    )
