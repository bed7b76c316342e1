"""The classical Duhem model, Eqs. (1)-(6) of Lee, Park, Baek (IJFIS 2013), corrected.

    heating:  dw/dv = (h₋ - w)/d · g₊         cooling:  dw/dv = (w - h₊)/d · g₋         d = h₋ - h₊ > 0,  g± = h±'

v is the input, w the state, h₊(v) the heating branch and h₋(v) the cooling branch. The scale k appears only once, in
the output y = offset + k w. In the form dw/dv = a w + b, a is -g₊/d on heating and g₋/d on cooling. One particular
solution P of each law is known, a branch of the major loop: P = h₊ on heating, P = h₋ on cooling. In both tails d is
the difference of two nearly equal numbers. So d is computed from ln h below the loop and from ln(1 - h) above the loop.
Then a tends to a Mills ratio instead of 0/0.

Each branch is a weighted sum of Gaussian distribution functions. Below the smallest and above the largest of all
means ± nine standard deviations, both branches agree to 1e-18, and the state is constant.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Self

import numpy as np

from smadrive.errors import ModelError
from smadrive.hysteresis.branch.certify import certify
from smadrive.hysteresis.branch.engine import Branch, BranchEngine
from smadrive.hysteresis.branch.model import BranchModel
from smadrive.hysteresis.branch.tabulate import integrate_rate, quadrature_points, tabulate
from smadrive.hysteresis.certificate import Certificate
from smadrive.hysteresis.mixture import GaussianMixture, MixtureLogs
from smadrive.hysteresis.model import check_output_map
from smadrive.numerics.arrays import FloatArray

_SATURATED = 9.0  # standard deviations beyond every component, where the state is constant
_NO_KINKS = np.empty(0)


class DuhemModel(BranchModel):
    """A Duhem model whose heating and cooling branches are mixtures of Gaussian distributions.

    Raises ModelError for an invalid scale, offset or range, for branches that cross inside `input_range`, lie outside
    `input_range` or are in the wrong order, and for branches that are too steep for a table.
    """

    def __init__(
        self,
        heating: GaussianMixture,
        cooling: GaussianMixture,
        scale: float,
        offset: float,
        input_range: tuple[float, float],
    ) -> None:
        lower, upper = check_output_map(scale, offset, input_range)
        spans = heating.span(_SATURATED), cooling.span(_SATURATED)
        start, end = max(lower, min(s[0] for s in spans)), min(upper, max(s[1] for s in spans))
        if start >= end:
            cure = f"widen it or check the units: the means are {heating.means + cooling.means}"
            raise ModelError("contains no part of the loop", where="input_range", value=(lower, upper), cure=cure)
        _refuse_crossing(heating, cooling, lower, upper)
        self.heating = heating
        self.cooling = cooling
        super().__init__(_tabulated(heating, cooling, start, end), scale, offset, (lower, upper))

    @classmethod
    def gaussian(
        cls,
        *,
        mu_heating: float,
        mu_cooling: float,
        sigma_heating: float,
        sigma_cooling: float,
        scale: float = 1.0,
        offset: float = 0.0,
        input_range: tuple[float, float],
    ) -> Self:
        """Return a model with one Gaussian distribution per branch, as in the paper.

        mu (mean), sigma (standard deviation) and input_range have the unit of v; scale and offset have the unit of y.
        Raises ModelError for invalid parameters, and for branches that cross.
        """
        if (mu_heating, mu_cooling, sigma_heating, sigma_cooling) == (75, 70, 35, -45):
            what = (
                "the paper's Table 1 is printed with μ and σ swapped: sigma_cooling = -45 is not a standard deviation, "
                "and with 45 the branches cross at v = 92.5, inside the range"
            )
            raise ModelError(what, where="Table 1", cure="use DuhemModel.table1()")
        heating = GaussianMixture((1.0,), (mu_heating,), (sigma_heating,))
        cooling = GaussianMixture((1.0,), (mu_cooling,), (sigma_cooling,))
        return cls(heating, cooling, scale, offset, input_range)

    @classmethod
    def table1(cls) -> Self:
        """Return the model of Table 1 of the paper, over the input range from -300 to 300.

        The scale is 40. The heating branch has the mean 35 and the standard deviation 75, the cooling branch -45 and
        70. The paper exchanges the columns of means and standard deviations; here they are in the right order.
        """
        return cls.gaussian(
            mu_heating=35, mu_cooling=-45, sigma_heating=75, sigma_cooling=70, scale=40, input_range=(-300, 300)
        )

    @classmethod
    def mixture(
        cls,
        *,
        heating: GaussianMixture,
        cooling: GaussianMixture,
        scale: float = 1.0,
        offset: float = 0.0,
        input_range: tuple[float, float],
    ) -> Self:
        """Return a model with several Gaussian distributions per branch.

        Raises ModelError for invalid parameters, and for branches that cross. On measured wires, one Gaussian per
        branch leaves an error of 2 to 4 % of the span, and two Gaussians per branch leave about 0.5 %.
        """
        return cls(heating, cooling, scale, offset, input_range)

    def admissible(self, v: float) -> tuple[float, float]:
        """Return the heating branch h₊(v) and the cooling branch h₋(v), between which the state w lies."""
        return self.engine.target(v, rising=True), self.engine.target(v, rising=False)

    def local_laws(self, v: FloatArray, *, rising: bool) -> tuple[FloatArray, FloatArray]:
        """Return a and b of dw/dv = a w + b at the inputs `v`, both in the shape of `v`; Eq. (9) of the paper.

        The laws are those of heating if `rising`, otherwise those of cooling.
        """
        heating, cooling = self.heating.logs(v), self.cooling.logs(v)
        log_gap = _log_gap(heating, cooling)
        if rising:
            rate = -np.exp(heating.pdf - log_gap)
            return rate, -rate * self.cooling.cdf(v)
        rate = np.exp(cooling.pdf - log_gap)
        return rate, -rate * self.heating.cdf(v)

    def certificate(self) -> Certificate:
        """Return the certificate, checked at the nodes of the tables.

        The contraction rate is the smallest |a| of the law dw/dv = a w + b at these nodes.
        """
        return certify(self.engine)


@lru_cache(maxsize=4)
def _tabulated(heating: GaussianMixture, cooling: GaussianMixture, start: float, end: float) -> BranchEngine:
    """Return the tables of a model. Models of equal branches share them: the same wire is often simulated again."""

    def branches(nodes: FloatArray) -> tuple[Branch, Branch]:
        return duhem_branches(grid_logs(heating, nodes), grid_logs(cooling, nodes), nodes)

    return tabulate(start, end, branches, _NO_KINKS)


def _log_gap(heating: MixtureLogs, cooling: MixtureLogs) -> FloatArray:
    """Return ln(h₋ - h₊), computed from h or from 1 - h, whichever is smaller; -inf where the branches cross."""
    below = cooling.cdf < heating.sf
    larger = np.where(below, cooling.cdf, heating.sf)
    ratio = np.where(below, heating.cdf - cooling.cdf, cooling.sf - heating.sf)
    with np.errstate(divide="ignore"):
        return np.asarray(larger + np.log(-np.expm1(np.minimum(ratio, 0.0))))


def grid_logs(mixture: GaussianMixture, nodes: FloatArray) -> MixtureLogs:
    """Return the logarithms of `mixture`, first at the nodes of a grid, then at its quadrature points."""
    return mixture.logs(np.concatenate([nodes, quadrature_points(nodes).ravel()]))


def duhem_branches(
    heating: MixtureLogs, cooling: MixtureLogs, nodes: FloatArray, steepest: float = np.inf
) -> tuple[Branch, Branch]:
    """Return the heating and the cooling branch at the nodes of a grid, from the `grid_logs` of both mixtures.

    `steepest` limits |a| of the law dw/dv = a w + b. If `steepest` is infinite, branches that cross raise ModelError.
    If `steepest` is finite, branches may cross, because a fit also tries such models.
    """
    log_gap, count = _log_gap(heating, cooling), len(nodes)
    crossed = ~np.isfinite(log_gap[:count])
    if crossed.any() and not np.isfinite(steepest):
        raise _crossing_error(float(nodes[np.argmax(crossed)]), float(nodes[0]), float(nodes[-1]))
    branches = []
    for sign, logs in ((-1.0, heating), (1.0, cooling)):
        rate = sign * np.exp(np.minimum(logs.pdf - log_gap, np.log(steepest)))
        exponent = integrate_rate(nodes, rate[count:].reshape(count - 1, -1)).exponent
        branches.append(Branch(exponent, rate[:count], np.exp(logs.cdf[:count]), np.exp(logs.pdf[:count])))
    return branches[0], branches[1]


def _refuse_crossing(heating: GaussianMixture, cooling: GaussianMixture, lower: float, upper: float) -> None:
    """Raise ModelError for branches of one Gaussian each that cross inside the range or are in the wrong order.

    They cross at v* = (μ₊σ₋ - μ₋σ₊)/(σ₋ - σ₊). Branches of several Gaussians are checked later, at the nodes of the
    table.
    """
    if len(heating.means) > 1 or len(cooling.means) > 1:
        return
    (mu_h,), (s_h,), (mu_c,), (s_c,) = heating.means, heating.sigmas, cooling.means, cooling.sigmas
    if s_h == s_c:
        if mu_h <= mu_c:
            raise _order_error(mu_h, mu_c)
        return
    crossing = (mu_h * s_c - mu_c * s_h) / (s_c - s_h)
    if lower <= crossing <= upper:
        raise _crossing_error(crossing, lower, upper)
    if mu_h <= mu_c:
        raise _order_error(mu_h, mu_c)


def _order_error(mu_heating: float, mu_cooling: float) -> ModelError:
    what = "must exceed mu_cooling, because a wire transforms at a higher input on heating than on cooling"
    return ModelError(what, where="mu_heating", value=mu_heating, limit=mu_cooling)


def _crossing_error(v: float, lower: float, upper: float) -> ModelError:
    what = f"cross inside the working range [{lower:g}, {upper:g}], where the Duhem slope is singular"
    cure = "bring the sigmas closer together, move the means apart or narrow input_range"
    return ModelError(what, where="branches", value=float(f"{v:.6g}"), cure=cure)
