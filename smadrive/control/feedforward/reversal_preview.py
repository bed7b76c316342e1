"""When the wire must leave for the other branch: it needs time to cross its hysteresis before the reference reverses.

At a turning point the temperature must go from one branch to the other: many kelvin in which the wire hardly moves.
Cooling is limited by the surroundings. A wire that waits for the reference is late by the whole way; a wire that leaves
too early misses the peak. The preview lets it leave when both errors are equal, which gives the smallest largest error:
the model computes the way at zero (or full) power at some points, and each is compared with the reference.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

from smadrive.control.estimation.observer import WireEstimate
from smadrive.control.references.reference import Reference
from smadrive.hysteresis import HysteresisState, InverseFeedforward
from smadrive.wire.wire_model import WireModel, WireState

POINTS = 28
"""Points of the way at which wire and reference are compared."""

HORIZON = 0.6
"""How far ahead a reversal is considered, in time constants of the wire."""

MISSED = 0.01
"""Largest fraction of the stroke by which the peak may be missed, however late the wire then is (steps)."""

BEYOND = 0.01
"""A wire beyond the meeting point by this fraction of the stroke has crossed its hysteresis earlier than expected."""


@dataclass(frozen=True, slots=True)
class Reversal:
    """The wire has left for the other branch and meets the reference at `meets_s`; `direction` is that of its phase."""

    meets_s: float
    meets_mm: float
    meets_c: float
    direction: int

    def is_over(self, time_s: float, hysteresis: HysteresisState, travel_mm: float) -> bool:
        """Whether the reference has come to the meeting point, or the wire is beyond it already."""
        beyond = self.direction * (hysteresis.y - self.meets_mm) / travel_mm
        return time_s >= self.meets_s or beyond > BEYOND


class _Crossing(NamedTuple):
    """A wire that leaves now: when it meets the reference, its largest errors before and after the peak (stroke)."""

    meets_s: float
    early: float
    late: float

    @property
    def is_due(self) -> bool:
        """Whether leaving later would cost more than leaving now."""
        return self.late >= self.early and self.late > 0.0 and self.early <= MISSED


class ReversalPreview:
    """Decides for one wire when it leaves its branch."""

    def __init__(self, wire: WireModel) -> None:
        self._wire = wire
        self._inverse = InverseFeedforward(wire.model)
        self._horizon_s = HORIZON * wire.balance.time_constant_s

    def update(
        self, estimate: WireEstimate, reference: Reference, time_s: float, direction: int, limit_w: float
    ) -> Reversal | None:
        """The reversal to begin now, at `time_s`; None while the wire should go on in `direction` (of its phase)."""
        upward = direction / self._wire.travel_mm > 0
        reverses_s = reference.next_reversal_s(time_s, 1 if upward else -1)
        if reverses_s > time_s + 0.5 * self._horizon_s:
            return None
        crossing = _crossing(self._shortfalls(estimate, reference, time_s, direction, limit_w), reverses_s)
        if not crossing.is_due:
            return None
        meets_s = max(crossing.meets_s, reverses_s)
        meets_mm = reference.value_mm(meets_s)
        return Reversal(meets_s, meets_mm, self._inverse.update(estimate.hysteresis, meets_mm).v, -direction)

    def _shortfalls(
        self, estimate: WireEstimate, reference: Reference, time_s: float, direction: int, limit_w: float
    ) -> Iterator[tuple[float, float]]:
        """Times, and by how much (stroke) a wire that leaves now is then behind the reference in `direction`."""
        state = WireState(estimate.temperature_c, estimate.hysteresis)
        power_w = (limit_w if direction < 0 else 0.0) + estimate.disturbance_w
        step_s, ahead = self._horizon_s / POINTS, direction / self._wire.travel_mm
        for _ in range(POINTS):
            state = self._wire.step(state, power_w, step_s)
            time_s += step_s
            yield time_s, ahead * (reference.value_mm(time_s) - state.hysteresis.y)


def _crossing(shortfalls: Iterable[tuple[float, float]], reverses_s: float) -> _Crossing:
    """Follow the wire until it meets the reference after the peak at `reverses_s`.

    It falls short of the reference before the peak, and until the reference has come down to it; from then on it is
    late, until it has caught up.
    """
    early = late = time_s = 0.0
    for time_s, short in shortfalls:
        if time_s <= reverses_s or (short > 0.0 and late == 0.0):
            early = max(early, short)
        elif short < 0.0:
            late = max(late, -short)
        else:
            break
    return _Crossing(time_s, early, late)
