"""The plans of the identification experiment, and the number of reversals that fits into a given duration.

**nested**. A major loop alone does not determine both parameters a and b of a rule, because w is a function of v on
each of its branches. So after two major loops the path makes inner loops, which shrink towards the middle: first from
the lowest temperature, then from the highest. So heating and cooling curves start from every depth of transformation.

**forc**. After the major loop the path makes first-order reversal curves: it heats from low_c to M_k and cools back to
low_c. While a Preisach wire cools from M_k, it follows its Everett function E (Mayergoyz 1986):

    falling   w(v) = w(M_k) - E(M_k, v)          rising   w(v) = w(m_k) + E(v, m_k)

So two neighbouring falling curves determine the cells of the Preisach plane between their reversals. But all falling
curves begin on the same heating branch, which does not determine a Duhem rule for heating. So rising curves follow: the
path cools from high_c to m_k and heats back to high_c. The rising curves are fewer, because the falling curves
determine most of the plane. A wire transforms at higher temperatures while it heats than while it cools. So no M_k lies
in the lowest part of the range (`FOOT_SHARE`), and no m_k in the highest part. The falling curves cover the part of the
plane that the rising curves leave out, and the other way round.

The falling curves come first, then the rising curves; they do not alternate. A falling curve begins and ends at low_c,
a rising curve at high_c. A rising curve between two falling curves would need an additional major loop, and a major
loop takes longer than a curve. In the order used here, the path from low_c to high_c after the falling curves, and the
path back at the end, form a second major loop. It shows the drift since the first major loop. The path takes every
second reversal temperature in one direction, and then the others in the opposite direction. So a drift does not look
like an effect of M_k or m_k, and the first half of the curves already covers the range.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import takewhile
from math import ceil, isfinite
from typing import NamedTuple

from smadrive.errors import ConfigError
from smadrive.identification.excitation import Excitation, path_length_k

FOOT_SHARE = 0.25
"""Share of the range from low_c to high_c that has no M_k (its lowest part), or no m_k (its highest part)."""

FALLING_PER_RISING = 3
"""The number of falling curves for each rising curve."""

MOST_REVERSALS = 40
"""The largest number of reversals of a plan for a given duration.

With more reversals, two neighbouring reversal temperatures would differ by less than the error of the control.
"""


class ExcitationPlan(NamedTuple):
    """A plan of the identification experiment.

    A number of reversals counts the inner loops from each end of the range (`nested`), or the falling curves (`forc`).

    turning_points_c    function that returns the turning points from low_c, high_c, start_c and a number of reversals
    usual               number of reversals, if neither this number nor a duration is given
    fewest              smallest number of reversals that is planned for a given duration
    """

    turning_points_c: Callable[[float, float, float, int], tuple[float, ...]]
    usual: int
    fewest: int


def planned_excitation(
    plan: str,
    low_c: float,
    high_c: float,
    rate_c_per_s: float,
    start_c: float,
    *,
    reversals: int | None = None,
    duration_s: float | None = None,
) -> Excitation:
    """Return the path of `plan`, with `reversals` or with as many reversals as fit into `duration_s`.

    The path starts at `start_c`, the present temperature of the wire. Without `reversals` and `duration_s` the plan has
    its usual number of reversals. With both, `duration_s` counts. ConfigError if `high_c` does not exceed `low_c`, if
    the path with the fewest reversals lasts longer than `duration_s`, and for a path that `Excitation` refuses.
    """
    _check_range(low_c, high_c)
    turning_points_c, usual, _ = PLANS[plan]
    if duration_s is not None:
        timed_from_c = start_c if isfinite(start_c) else low_c  # a thermocouple fault is not an error of the plan
        reversals = _most_reversals(PLANS[plan], low_c, high_c, timed_from_c, rate_c_per_s, duration_s)
    points = turning_points_c(low_c, high_c, start_c, usual if reversals is None else reversals)
    return Excitation(points, rate_c_per_s, plan)


def _check_range(low_c: float, high_c: float) -> None:
    if not high_c > low_c:
        raise ConfigError("must exceed low_c", where="excitation.high_c", value=high_c, limit=low_c)


def _most_reversals(
    plan: ExcitationPlan, low_c: float, high_c: float, start_c: float, rate_c_per_s: float, duration_s: float
) -> int:
    """Return the largest number of reversals whose path lasts at most `duration_s`. ConfigError if none does."""

    def lasts_s(reversals: int) -> float:
        return path_length_k(plan.turning_points_c(low_c, high_c, start_c, reversals)) / rate_c_per_s

    numbers = range(plan.fewest, MOST_REVERSALS + 1)
    fitting = list(takewhile(lambda number: lasts_s(number) <= duration_s, numbers))
    if not fitting:
        shortest_s = lasts_s(plan.fewest)
        raise ConfigError(
            f"too short: this plan needs at least {plan.fewest} reversals",
            where="excitation.duration_s",
            value=f"{duration_s:g} s",
            limit=f"at least {ceil(shortest_s)} s at rate_c_per_s = {rate_c_per_s:g}",
            cure=f"raise duration_s to {ceil(shortest_s)}",
        )
    return fitting[-1]


def _nested(low_c: float, high_c: float, start_c: float, reversals: int) -> tuple[float, ...]:
    """Return the turning points of two full loops, then inner loops that shrink: from `low_c`, then from `high_c`."""
    points = [start_c, *[high_c, low_c] * 2]
    middle_c = 0.5 * (low_c + high_c)
    shrinking = [(high_c - middle_c) * (reversals - n) / (reversals + 1) for n in range(reversals)]
    for half_c in shrinking:
        points += [middle_c + half_c, middle_c - half_c]
    points += [low_c, high_c]
    for half_c in shrinking:
        points += [middle_c - half_c, middle_c + half_c]
    return (*points, high_c, low_c)


def _first_order(low_c: float, high_c: float, start_c: float, reversals: int) -> tuple[float, ...]:
    inner_k = (1.0 - FOOT_SHARE) * (high_c - low_c)
    points = [start_c, high_c, low_c]
    for depth in _up_and_down(_depths(reversals)[::-1]):
        points += [high_c - inner_k * depth, low_c]
    points.append(high_c)
    for depth in _up_and_down(_depths(ceil(reversals / FALLING_PER_RISING))[::-1]):
        points += [low_c + inner_k * depth, high_c]
    return (*points, low_c)


def _depths(count: int) -> list[float]:
    """Return `count` evenly spaced shares between 0 and 1, without these ends."""
    return [n / (count + 1) for n in range(1, count + 1)]


def _up_and_down(values: Sequence[float]) -> list[float]:
    """Return every second value in order, then the others in reverse order."""
    return [*values[::2], *values[1::2][::-1]]


PLANS = {"nested": ExcitationPlan(_nested, 5, 2), "forc": ExcitationPlan(_first_order, 15, 5)}
"""The plans by their names in the rig file."""
