"""Change of place, width and scale of the branches of a model, for a wire whose branches have moved or become wider.

The place μ and the spread σ of a branch P(v) of the major loop are the mean and the standard deviation of its slope,
taken as a distribution over the input v:

    μ = ∫ v dP / ∫ dP        σ² = ∫ (v - μ)² dP / ∫ dP

A new law of the state results from the old law: with u(v) = μ_old + (v - μ_new) σ_old/σ_new, the new law at v is the
old law at u, divided by the stretch σ_new/σ_old. For a Duhem model this is exact. In a T-S fuzzy model both branches
share the sets of the rules. So each centre moves by the mean of the moves of both branches, and the new consequents are
interpolated between the old consequents. Contraction and boundedness depend only on the signs of the rates, so the new
model is contracting and bounded, too. Slopes that have the wrong sign in the new model are corrected.
"""

from __future__ import annotations

from dataclasses import replace
from math import nan, sqrt
from typing import NamedTuple

import numpy as np

from smadrive.errors import ModelError
from smadrive.hysteresis import (
    DuhemModel,
    GaussianMixture,
    IdentifiedModel,
    PreisachPlane,
    TSFuzzyDuhem,
    TSFuzzyPreisach,
)
from smadrive.hysteresis.fuzzy import FuzzySets
from smadrive.hysteresis.memory.plane import in_plane
from smadrive.hysteresis.tsfuzzy import Law, MembershipGrid
from smadrive.identification.tsfuzzy.monotone import monotone
from smadrive.numerics.arrays import FloatArray

_INVERTIBLE = 0.999
"""Slopes are corrected if `Certificate.invertible_share` is at most this value: a better share is good enough."""


_CLOSEST = 1e-6
"""Least distance of two thresholds or centres that are moved to an end of the input range, as a share of the range."""


class BranchShape(NamedTuple):
    """Places and spreads of both branches, in the unit of the input, and scale of the output, in the unit of y.

    The place mu is the input in the middle of a branch, and the spread sigma tells how wide the branch is: they are
    mean and standard deviation of the slope of the branch, taken as a distribution over the input.
    """

    mu_heating: float
    mu_cooling: float
    sigma_heating: float
    sigma_cooling: float
    scale: float


class _Move(NamedTuple):
    """The move of one branch from place `mu` and spread `sigma` to `new_mu` and `new_sigma`."""

    mu: float
    sigma: float
    new_mu: float
    new_sigma: float

    @property
    def stretch(self) -> float:
        return self.new_sigma / self.sigma

    def forth(self, v: FloatArray) -> FloatArray:
        return self.new_mu + (v - self.mu) * self.stretch

    def aimed(self, reached_mu: float, reached_sigma: float) -> _Move:
        return _Move(self.mu, self.sigma, 2 * self.new_mu - reached_mu, self.new_sigma * self.new_sigma / reached_sigma)

    def back(self, v: FloatArray) -> FloatArray:
        return self.mu + (v - self.new_mu) / self.stretch


class _Rules(NamedTuple):
    """The rules of a T-S model."""

    sets: FuzzySets
    heating_law: Law
    cooling_law: Law


def shape_of(model: IdentifiedModel) -> BranchShape:
    """Return the shape of the major loop of `model`: places and spreads of both branches, and the scale."""
    nodes = (model.local if isinstance(model, TSFuzzyPreisach) else model).engine.nodes
    mu_heating, sigma_heating = _moments(nodes, model.branch(nodes, rising=True))
    mu_cooling, sigma_cooling = _moments(nodes, model.branch(nodes, rising=False))
    return BranchShape(mu_heating, mu_cooling, sigma_heating, sigma_cooling, model.scale)


def reshaped(model: IdentifiedModel, shape: BranchShape) -> IdentifiedModel:
    """Return `model` with its branches and its scale changed to `shape`.

    ModelError for a shape that is impossible, or that lies outside the input range of the model.
    """
    _check(model, shape)
    now = shape_of(model)
    _check_widths(now.sigma_heating, now.sigma_cooling)
    heating = _Move(now.mu_heating, now.sigma_heating, shape.mu_heating, shape.sigma_heating)
    cooling = _Move(now.mu_cooling, now.sigma_cooling, shape.mu_cooling, shape.sigma_cooling)
    if isinstance(model, DuhemModel):
        mixtures = _moved_mixture(model.heating, heating), _moved_mixture(model.cooling, cooling)
        return DuhemModel(*mixtures, shape.scale, model.offset, model.input_range)
    if isinstance(model, TSFuzzyPreisach):
        return _moved_with_memory(model, heating, cooling, shape.scale)
    reached = _moments_of_rules(_moved_rules(model, heating, cooling), model.engine.nodes)
    _check_widths(*(sigma for _, sigma in reached))
    heating, cooling = (  # corrected by the error that the coarse grid of rules made
        move.aimed(*moments) for move, moments in zip((heating, cooling), reached, strict=True)
    )
    rules = _moved_rules(model, heating, cooling)
    moved = TSFuzzyDuhem.from_laws(*rules, shape.scale, model.offset, model.input_range)
    return moved if moved.certificate().invertible_share > _INVERTIBLE else monotone(moved)


def _moved_with_memory(model: TSFuzzyPreisach, heating: _Move, cooling: _Move, scale: float) -> TSFuzzyPreisach:
    """Return the model with its rules and its plane moved.

    `heating` moves the heating branch and the up-thresholds, `cooling` the cooling branch and the down-thresholds.
    """
    now = shape_of(model.local)
    rules = reshaped(
        model.local,
        BranchShape(
            float(heating.forth(np.array(now.mu_heating))),
            float(cooling.forth(np.array(now.mu_cooling))),
            now.sigma_heating * heating.stretch,
            now.sigma_cooling * cooling.stretch,
            scale,
        ),
    )
    plane = model.plane
    up, down = heating.forth(plane.up_thresholds), cooling.forth(plane.down_thresholds)
    moved = moved_plane(up, down, plane.mass, model.input_range)
    assert isinstance(rules, TSFuzzyDuhem)
    return TSFuzzyPreisach(rules, moved, model.share)


def moved_plane(up: FloatArray, down: FloatArray, mass: FloatArray, ends: tuple[float, float]) -> PreisachPlane:
    """Return the plane with the thresholds `up` and `down`, which have moved, and with the masses `mass` of its cells.

    Thresholds outside the input range `ends` move to the nearest end. After the move, the relays of a cell may have
    down-thresholds above their up-thresholds. The mass of such a cell goes to the next possible cell with the same
    down-thresholds and higher up-thresholds. If no such cell exists, the mass goes to a possible cell with the highest
    up-thresholds. The sum of the masses stays 1.
    """
    up, down = _within(up, ends), _within(down, ends)
    allowed, masses = in_plane(up, down), mass.copy()
    for i, j in np.argwhere((masses > 0) & ~allowed).tolist():
        later = np.flatnonzero(allowed[i:, j])
        row, column = (i + int(later[0]), j) if later.size else (len(up) - 2, _last(allowed[-1, : j + 1]))
        masses[row, column] += masses[i, j]
        masses[i, j] = 0.0
    return PreisachPlane(up, down, masses)


def _last(allowed: np.ndarray) -> int:
    return int(np.flatnonzero(allowed)[-1])


def _within(places: FloatArray, ends: tuple[float, float]) -> FloatArray:
    """Return thresholds or centres, limited to the range `ends` and still ascending."""
    steps = _CLOSEST * (ends[1] - ends[0]) * np.arange(len(places))
    return np.asarray(np.clip(places, ends[0] + steps, ends[1] - steps[::-1]))


def _check(model: IdentifiedModel, shape: BranchShape) -> None:
    lower, upper = model.input_range
    for name, value in shape._asdict().items():
        if name.startswith("mu") and not lower < value < upper:
            limit = f"{lower:g} to {upper:g}"
            raise ModelError("outside the model's range", where=name, value=value, limit=limit)
        if name.startswith("sigma") and not 0 < value < upper - lower:
            limit = f"0 to {upper - lower:g}"
            raise ModelError("not positive, or wider than the model's range", where=name, value=value, limit=limit)
    if not shape.mu_heating > shape.mu_cooling:
        what = "must exceed mu_cooling, because a wire transforms later on heating"
        raise ModelError(what, where="mu_heating", value=shape.mu_heating, limit=shape.mu_cooling)
    if not shape.scale * model.scale > 0:
        value = f"{shape.scale:g}, of the model {model.scale:g}"
        raise ModelError(
            "zero, or of another sign than that of the model", where="scale", value=value, cure="keep its sign"
        )


def _check_widths(*sigmas: float) -> None:
    if not all(sigma > 0.0 for sigma in sigmas):
        what, cure = "a branch does not rise from its lower to its upper end", "undo the change of the rules"
        raise ModelError(what, where="rules", cure=cure)


def _moments(nodes: FloatArray, branch: FloatArray) -> tuple[float, float]:
    """Return mean and standard deviation of v, weighted with the slope of `branch`; NaN and 0 if it does not rise."""
    rise, middle = np.diff(branch), (nodes[1:] + nodes[:-1]) / 2
    if not rise.sum() > 0.0:
        return nan, 0.0
    mean = float(middle @ rise / rise.sum())
    return mean, sqrt(max(0.0, float((middle - mean) ** 2 @ rise / rise.sum())))


def _moved_mixture(mixture: GaussianMixture, move: _Move) -> GaussianMixture:
    means = move.forth(np.array(mixture.means))
    return GaussianMixture(mixture.weights, tuple(means.tolist()), tuple(s * move.stretch for s in mixture.sigmas))


def _moved_rules(model: TSFuzzyDuhem, heating: _Move, cooling: _Move) -> _Rules:
    old = np.array(model.sets.centres)
    centres = _within((heating.forth(old) + cooling.forth(old)) / 2, model.input_range)

    def law(values: Law, move: _Move) -> Law:
        a, b = (np.interp(move.back(centres), old, part) / move.stretch for part in values)
        return a, b

    sets = replace(model.sets, centres=tuple(centres.tolist()))  # type: ignore[type-var]
    return _Rules(sets, law(model.heating_law, heating), law(model.cooling_law, cooling))


def _moments_of_rules(rules: _Rules, nodes: FloatArray) -> list[tuple[float, float]]:
    """Return place and spread of both branches of `rules`.

    `nodes` may be the grid of another model. Such a grid is accurate enough, and four times as fast as a new grid.
    """
    branches = MembershipGrid(rules.sets, nodes).closed_branches(rules.heating_law, rules.cooling_law)
    return [_moments(nodes, branch.target) for branch in branches]
