"""The resistance of the identified wire, and the displacement that follows from it.

    R(T, ξ) = (1 - e ξ)² [(1 - ξ) f(T) + ξ g(T)]

T is the temperature of the wire and ξ the phase: the displacement as a share of the travel. f is the resistance of the
martensite, linear in T. g is the resistance of the austenite, a natural cubic spline in T. A spline is needed because
an R-phase in the austenite raises g on cooling. The hysteresis of the R-phase, 1 to 2 K, is left out. The
factor (1 - e ξ)² is the geometry: a wire that contracts by the share e becomes shorter and thicker at a constant
volume.

At a known temperature, R determines ξ, because R falls (or rises) with ξ. A noise of σ_R makes an error of
σ_R / |dR/dξ|, so the displacement is lost where dR/dξ is nearly zero. A current I measured with the noise σ_I, and a
voltage with σ_V, give

    σ_R = σ_U / I        σ_U = sqrt(σ_V² + R² σ_I²)

A device samples (or averages) current and voltage before it answers. So U/I is older than the readings of the sensors,
by `delay_s`. A device that averages has a delay of about half its averaging period.

`WireModel.resistance_ohm` uses this model if it was identified, otherwise the coarser R(w) of heat_balance.py.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import isfinite

import numpy as np
import scipy

from smadrive.errors import ModelError
from smadrive.numerics.arrays import FloatArray
from smadrive.numerics.piecewise_linear import PiecewiseLinear

CELLS_PER_NODE = 16
"""The spline is looked up in a table with this number of cells between two nodes."""

FAR_C = 200.0
"""The spline continues as a straight line for this distance beyond its nodes, K."""

STEPS = 4
"""Newton steps to the phase. The resistance is nearly linear in the phase, so each step gains several digits."""

CLOSE = 1e-6
"""Newton's method ends after a step below this, because the next step would be far smaller."""

LEAST_NODES = 3

RANGES = {
    "reference_c": (-50.0, 300.0),
    "martensite_ohm": (1e-3, 1e4),
    "strain": (0.0, 0.2),
    "noise_v": (1e-7, 10.0),
    "error_ohm": (0.0, 1e3),
    "delay_s": (-1.0, 1.0),
}
"""The range of each parameter, beyond which it belongs to no wire and no device."""

NODES_C = -100.0, 600.0
"""Range of the nodes, °C."""

RATIOS = 0.5, 1.6
"""Least and largest ratio of the resistances of austenite and martensite; alloys have some 0.8 to 1.3."""

MOST_PER_K = 0.02
"""Largest change of the austenite's resistance over a kelvin, as a share. The R-phase of an alloy makes some 0.005."""

LEAST_CHANGE = 1e-3
"""Least change of the resistance over the stroke, as a share."""

NUMBERS = ("reference_c", "martensite_ohm", "martensite_ohm_per_k", "strain", "noise_v", "error_ohm", "delay_s")
"""The parameters that are single numbers."""

SPLINE = ("nodes_c", "austenite_ohm")
"""The parameters that are lists of numbers."""


@dataclass(frozen=True)
class WireResistance:
    """The parameters of the equations at the head of this file. Raises ModelError for impossible parameters.

    reference_c             temperature at which the martensite has `martensite_ohm`, °C
    martensite_ohm          f at `reference_c`, Ω
    martensite_ohm_per_k    slope of f, Ω/K
    strain                  e, the contraction of the whole stroke as a share of the length
    noise_v                 σ_U, the noise of the measurement as a voltage, V
    error_ohm               standard error of R by the fit, Ω
    delay_s                 age of current and voltage, compared with the readings of the sensors, s
    nodes_c, austenite_ohm  nodes of the spline g, in °C and Ω
    """

    reference_c: float
    martensite_ohm: float
    martensite_ohm_per_k: float
    strain: float
    noise_v: float
    error_ohm: float
    delay_s: float
    nodes_c: tuple[float, ...]
    austenite_ohm: tuple[float, ...]

    def __post_init__(self) -> None:
        """Raise ModelError for parameters that are not finite, or that no wire can have."""
        for name in NUMBERS:
            if not isfinite(value := getattr(self, name)):
                raise ModelError("not finite", where=f"resistance: {name}", value=value)
        for name, values in (("martensite_ohm", (self.martensite_ohm,)), ("austenite_ohm", self.austenite_ohm)):
            if not all(0.0 < value < np.inf for value in values):
                raise ModelError("not positive", where=f"resistance: {name}", value=min(values))
        for name, (low, high) in RANGES.items():
            if not low <= (value := getattr(self, name)) <= high:
                raise ModelError(
                    "out of its range", where=f"resistance: {name}", value=value, limit=f"{low:g} to {high:g}"
                )
        nodes = self.nodes_c
        if len(nodes) < LEAST_NODES or len(nodes) != len(self.austenite_ohm) or not np.all(np.diff(nodes) > 0.0):
            what = "needs ascending nodes, each with one value"
            raise ModelError(what, where="resistance: nodes_c", value=len(nodes), limit=f"at least {LEAST_NODES}")
        low_c, high_c = NODES_C
        if not (low_c <= nodes[0] and nodes[-1] <= high_c):
            limits = f"{low_c:g} to {high_c:g} °C"
            wrong_c = nodes[0] if nodes[0] < low_c else nodes[-1]
            raise ModelError("out of its range", where="resistance: nodes_c", value=f"{wrong_c:g} °C", limit=limits)

    def check_change(self) -> None:
        """Raise ModelError if the resistance hardly depends on the phase, or depends on it as that of no alloy."""
        ratios = [
            austenite / self._pure_ohm(at_c)[0]
            for at_c, austenite in zip(self.nodes_c, self.austenite_ohm, strict=True)
        ]
        low, high = RATIOS
        if not (low < min(ratios) and max(ratios) < high):
            what = "austenite and martensite differ by more than in any alloy"
            limits = f"ratio {low:g} to {high:g}"
            raise ModelError(what, where="resistance: austenite_ohm", value=f"ratio {max(ratios):.3g}", limit=limits)
        per_k = float(np.max(np.abs(np.diff(self.austenite_ohm) / np.diff(self.nodes_c)))) / self.martensite_ohm
        if per_k > MOST_PER_K:
            what, limits = "the austenite changes over a kelvin by more than in any alloy", f"{MOST_PER_K:g} per K"
            raise ModelError(what, where="resistance: austenite_ohm", value=f"{per_k:.3g} per K", limit=limits)
        if max(abs(ratio - 1.0) for ratio in ratios) < LEAST_CHANGE and self.strain < LEAST_CHANGE:
            what, limits = "the resistance does not depend on the phase", f"a change of {100 * LEAST_CHANGE:g} %"
            raise ModelError(what, where="resistance: austenite_ohm", value=f"ratio {ratios[0]:.6g}", limit=limits)

    def ohm(self, temperature_c: float, phase: float) -> float:
        """Return the resistance R in Ω, at the temperature in °C and at the phase, 0 for the cold wire."""
        martensite, austenite = self._pure_ohm(temperature_c)
        return (1.0 - self.strain * phase) ** 2 * (martensite + (austenite - martensite) * phase)

    def ohm_per_phase(self, temperature_c: float, phase: float) -> float:
        """Return the slope dR/dξ at a constant temperature, Ω."""
        return self._slope(*self._pure_ohm(temperature_c), phase)

    def phase(self, ohm: float, temperature_c: float, start: float) -> float:
        """Return the phase at which the wire has the resistance `ohm` at this temperature.

        Newton's method begins at the phase `start`. The result may lie outside [0, 1], because of noise. It is NaN
        where the resistance does not depend on the phase.
        """
        martensite, austenite = self._pure_ohm(temperature_c)
        phase = start
        for _ in range(STEPS):
            geometry = 1.0 - self.strain * phase
            slope = self._slope(martensite, austenite, phase)
            if slope == 0.0:
                return np.nan
            step = (ohm - geometry**2 * (martensite + (austenite - martensite) * phase)) / slope
            phase = min(max(phase + step, -1.0), 2.0)
            if abs(step) < CLOSE:
                break
        return phase

    def _slope(self, martensite: float, austenite: float, phase: float) -> float:
        geometry, mixed = 1.0 - self.strain * phase, martensite + (austenite - martensite) * phase
        return geometry * (geometry * (austenite - martensite) - 2.0 * self.strain * mixed)

    def _pure_ohm(self, temperature_c: float) -> tuple[float, float]:
        """Return f and g, the resistances of the martensite and of the austenite, Ω."""
        warmer_k = temperature_c - self.reference_c
        return self.martensite_ohm + self.martensite_ohm_per_k * warmer_k, self._austenite.at(temperature_c)

    @cached_property
    def _austenite(self) -> PiecewiseLinear:
        """The spline g as a table."""
        nodes = np.asarray(self.nodes_c)
        cells = np.linspace(0.0, len(nodes) - 1.0, CELLS_PER_NODE * (len(nodes) - 1) + 1)
        places = np.interp(cells, np.arange(len(nodes)), nodes)
        places = np.concatenate(([nodes[0] - FAR_C], places, [nodes[-1] + FAR_C]))
        return PiecewiseLinear(places, spline_design(places, nodes) @ np.asarray(self.austenite_ohm))


def spline_design(temperature_c: FloatArray, nodes_c: FloatArray) -> FloatArray:
    """Return the matrix (samples, nodes) that maps the values at the nodes to the values of the spline.

    Beyond its nodes the spline is a straight line.
    """
    spline = scipy.interpolate.CubicSpline(nodes_c, np.eye(len(nodes_c)), bc_type="natural")
    inside = np.clip(temperature_c, nodes_c[0], nodes_c[-1])
    matrix: FloatArray = spline(inside) + (temperature_c - inside)[:, None] * spline(inside, 1)
    return matrix
