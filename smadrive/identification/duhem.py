"""Identification of a Duhem model from its output error.

The unknowns are the mean, width and weight of every Gaussian of both branches, the scale and the offset. The fit
minimises the error of the simulated output; a fit of slopes would amplify noise and bias the loop. The first fit has
one Gaussian per branch. Fits with more Gaussians start from this fit, with each Gaussian split in several ways. The
branches must not cross. The distance of the heating branch h₊ and the cooling branch h₋ is Φ⁻¹(h₋) - Φ⁻¹(h₊), where
Φ⁻¹ is the inverse of the normal distribution function. A penalty acts where this distance is less than a margin. The
fit raises the penalty until the model is valid over the range.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
import scipy

from smadrive.errors import IdentificationError, ModelError
from smadrive.hysteresis.branch.engine import BranchEngine
from smadrive.hysteresis.duhem import DuhemModel, duhem_branches, grid_logs
from smadrive.hysteresis.mixture import MOST_COMPONENTS, GaussianMixture, MixtureLogs
from smadrive.identification.quality.caveats import undetermined
from smadrive.identification.quality.metrics import Fit, judge
from smadrive.identification.quality.uncertainty import DuhemErrors, MixtureErrors, standard_errors
from smadrive.identification.record import Record, prepare
from smadrive.numerics.levenberg_marquardt import Minimum, forward_differences, minimise
from smadrive.numerics.scalars import whole_number

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from smadrive.numerics.arrays import FloatArray

_CELLS = 192  # of the table of a trial model: the error of the table is far below measurement errors
_STEEPEST = 1e3  # rate of a trial model per input span, where its branches touch
_MARGIN = 0.05  # standard deviations between the branches
_PENALTIES = (0.03, 0.3, 3.0, 30.0)
_TRY, _POLISH = 12, 60  # iterations from each start, and from the best result
_TOLERANCE = 1e-5  # relative gain at which to stop
_BOUNDS = (  # of means, log widths and weights' logits, then of scale and offset; in spans
    ((-1.0, -5.0, -6.0), (-5.0, -10.0)),
    ((2.0, 1.0, 6.0), (5.0, 10.0)),
)
_SPLITS = ((0.6, 0.6, 0.9), (0.0, 0.5, 1.5), (0.9, 0.7, 0.7))  # shift and widths, in σ of the single Gaussian


@dataclass(frozen=True, slots=True)
class DuhemFit(Fit[DuhemModel]):
    """An identified Duhem model, its metrics, and the standard errors of its parameters."""

    standard_errors: DuhemErrors


def identify_duhem(v: ArrayLike, y: ArrayLike, components: int = 2, *, dead_band: float | None = None) -> DuhemFit:
    """Fit a Duhem model with `components` Gaussians per branch to a record, and return the model with its metrics.

    v and y are input and output of one wire, both (samples,). `dead_band` is the radius of the reversal filter in the
    unit of v; without `dead_band` the radius follows from the noise of v. Raises DataError for samples that cannot be
    used, IdentificationError when the record does not determine a loop.
    """
    count = whole_number(components, "components", "Gaussians per branch", 1, MOST_COMPONENTS, IdentificationError)
    problem, x, fit = _solve(prepare(v, y, dead_band), count)
    errors = problem.standard_errors(x, fit.residual)
    caveats = undetermined("heating", fit.model.heating, errors.heating)
    caveats += undetermined("cooling", fit.model.cooling, errors.cooling)
    figures = {field.name: getattr(fit, field.name) for field in fields(fit)} | {"caveats": fit.caveats + caveats}
    return DuhemFit(**figures, standard_errors=errors)


def fit_duhem(record: Record, components: int) -> Fit[DuhemModel]:
    """Fit a Duhem model with `components` Gaussians per branch to a prepared record, without standard errors."""
    return _solve(record, components)[2]


def _solve(record: Record, components: int) -> tuple[_Problem, FloatArray, Fit[DuhemModel]]:
    problem = _Problem(record, _PENALTIES[0])
    x = problem.solve(problem.first_guess(), _POLISH).x
    if components > 1:
        tries = [problem.solve(start, _TRY) for start in problem.splits(x, components)]
        x = min(tries, key=lambda minimum: minimum.cost).x
    for penalty in _PENALTIES:
        problem = _Problem(record, penalty)
        x = problem.solve(x, _POLISH).x
        try:
            model = problem.model(x)
        except ModelError:
            continue
        return problem, x, judge(model, record, float(record.mean_y[0]))
    cure = "check the order of the samples, and that the output changes at a higher input on heating than on cooling"
    raise IdentificationError(
        "heating and cooling branch cross in every fit of this record", where="branches", cure=cure
    )


@dataclass(frozen=True, slots=True)
class _Problem:
    """Least squares over the vector x; inputs and outputs are measured in spans of the record.

    x = (means, log widths and logits of the weights of the heating branch; the same of the cooling branch; scale,
         offset)
    """

    record: Record
    penalty: float

    def mixtures(self, x: FloatArray) -> tuple[GaussianMixture, GaussianMixture]:
        lower, upper = self.record.input_range
        span = upper - lower
        made = []
        for means, log_widths, logits in x[:-2].reshape(2, 3, -1):
            weights = scipy.special.softmax(logits) * (1 - 1e-3) + 1e-3 / len(logits)
            widths = span * np.exp(log_widths)
            made.append(
                GaussianMixture(
                    *(tuple(part.tolist()) for part in (weights / weights.sum(), lower + span * means, widths))
                )
            )
        return made[0], made[1]

    def output_map(self, x: FloatArray) -> tuple[float, float]:
        return float(x[-2]) * self.record.output_span, float(x[-1]) * self.record.output_span

    def model(self, x: FloatArray) -> DuhemModel:
        scale, offset = self.output_map(x)
        return DuhemModel(*self.mixtures(x), scale, offset, self.record.input_range)

    def residuals(self, x: FloatArray) -> FloatArray:
        record = self.record
        heating, cooling = (_logs(mixture, record.input_range) for mixture in self.mixtures(x))
        scale, offset = self.output_map(x)
        nodes = _nodes(record.input_range)
        engine = BranchEngine(
            nodes, _CELLS, *duhem_branches(heating, cooling, nodes, _STEEPEST / (nodes[-1] - nodes[0]))
        )
        bounds = sorted(float(np.interp(record.v[0], nodes, m.target)) for m in (engine.heating, engine.cooling))
        start = min(max((record.mean_y[0] - offset) / scale, bounds[0]), bounds[1])
        error = (offset + scale * engine.trajectory(record.v, start) - record.mean_y) / record.output_span
        some = slice(0, len(nodes), 4)
        gap = _probit(cooling.cdf[some], cooling.sf[some]) - _probit(heating.cdf[some], heating.sf[some])
        crossing = self.penalty * np.sqrt(len(record.path) / len(gap)) * np.maximum(_MARGIN - gap, 0)
        return np.concatenate([error * np.sqrt(record.count), crossing])

    def solve(self, x: FloatArray, iterations: int) -> Minimum:
        shape = len(x[:-2]) // 6
        low, high = (np.concatenate([np.tile(np.repeat(ends, shape), 2), rest]) for ends, rest in _BOUNDS)
        return minimise(self.residuals, self.jacobian, x, (low, high), iterations=iterations, tolerance=_TOLERANCE)

    def jacobian(self, x: FloatArray) -> list[FloatArray]:
        """Return ∂r/∂x in one block."""
        return [forward_differences(self.residuals, x)]

    def parameters(self, x: FloatArray) -> FloatArray:
        """Return weights, means and sigmas of the heating branch and of the cooling branch, then scale and offset."""
        parts = [np.array((m.weights, m.means, m.sigmas)) for m in self.mixtures(x)]
        return np.concatenate([np.ravel(parts), self.output_map(x)])

    def standard_errors(self, x: FloatArray, residual: FloatArray) -> DuhemErrors:
        """Return the standard errors of the parameters at the minimum x; `residual` (samples,) has the unit of y."""
        jacobian = self.jacobian(x)[0][: len(self.record.v)]
        slopes = forward_differences(self.parameters, x)
        *branches, scale, offset = standard_errors(jacobian, slopes, residual / self.record.output_span)
        heating, cooling = (MixtureErrors(*map(tuple, one)) for one in np.reshape(branches, (2, 3, -1)).tolist())
        return DuhemErrors(heating, cooling, float(scale), float(offset))

    def first_guess(self) -> FloatArray:
        """Return a start with one Gaussian per branch, from the quantiles of a monotone curve through the samples."""
        record = self.record
        lower, upper = record.input_range
        falls = np.corrcoef(record.v, record.mean_y)[0, 1] < 0
        low, high = np.percentile(record.mean_y, (1, 99))
        scale, offset = (low - high, high) if falls else (high - low, low)
        quantiles = []
        for rising in (True, False):
            chosen = record.rising == rising
            order = np.argsort(record.v[chosen], kind="stable")
            place = (record.v[chosen][order] - lower) / (upper - lower)
            curve = scipy.optimize.isotonic_regression((record.mean_y[chosen][order] - offset) / scale).x
            quantiles.append([place[min(np.searchsorted(curve, q), len(place) - 1)] for q in (0.16, 0.5, 0.84)])
        (a1, a2, a3), (c1, c2, c3) = quantiles
        width = max((a3 - a1 + c3 - c1) / 4, 0.01)
        a2 = max(a2, c2 + 0.1 * width)
        log_width = np.log(width)
        return np.array(
            [a2, log_width, 0.0, c2, log_width, 0.0, scale / record.output_span, offset / record.output_span]
        )

    def splits(self, x: FloatArray, components: int) -> list[FloatArray]:
        """Return starts with more Gaussians: the solution with one Gaussian, split with several shifts and widths."""
        branches = x[:-2].reshape(2, 3)
        starts = []
        for shift, first_width, last_width in _SPLITS:
            made = []
            for mean, log_width, _ in branches:
                place = np.linspace(-1, 1, components)
                widths = np.linspace(first_width, last_width, components)
                made.append(
                    [mean + shift * place * np.exp(log_width), log_width + np.log(widths), np.zeros(components)]
                )
            starts.append(np.concatenate([np.ravel(made), x[-2:]]))
        return starts


def _nodes(input_range: tuple[float, float]) -> FloatArray:
    return np.linspace(*input_range, _CELLS + 1)


@lru_cache(maxsize=4)
def _logs(mixture: GaussianMixture, input_range: tuple[float, float]) -> MixtureLogs:
    """Return `grid_logs` of a mixture.

    The result is cached, because a change of one branch's variables does not change the other branch.
    """
    return grid_logs(mixture, _nodes(input_range))


def _probit(log_cdf: FloatArray, log_sf: FloatArray) -> FloatArray:
    """Return Φ⁻¹(h) from the logarithms of h and 1 - h, exact in both tails."""
    lower_half = log_cdf < log_sf
    tail = scipy.special.ndtri_exp(np.minimum(log_cdf, log_sf))
    return np.where(lower_half, tail, -tail)
