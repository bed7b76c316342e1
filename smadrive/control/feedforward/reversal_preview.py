"""When to turn: a wire needs time to cross its hysteresis, and must start before the reference turns.

At a turning point the temperature has to go from one branch to the other, many kelvin in which the wire hardly moves.
Cooling is as fast as the room allows and no faster. If the wire waits for the reference it comes late by the whole way;
if it leaves too soon it misses the peak. Here it leaves when both errors are equal, the smallest largest error there
is: the way at zero (or full) power is computed with the model, a handful of points, and compared with the reference.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from smadrive.control.estimation.observer import WireEstimate
from smadrive.control.references.reference import Reference
from smadrive.hysteresis import HysteresisState, InverseFeedforward
from smadrive.wire.wire_model import WireModel, WireState

POINTS = 28
"""Points of the way at which wire and reference are compared."""

HORIZON = 0.6
"""How far ahead a turn is considered, in time constants of the wire."""

MISSED = 0.01
"""By no more than this fraction of the stroke is the peak missed, however late the wire comes then (steps)."""

BEYOND = 0.01
"""A wire beyond the meeting point by this fraction of the stroke did not need the way that the model gave it."""


@dataclass(frozen=True, slots=True)
class Turn:
    """The wire has left for the other branch, to meet the reference at `meets_s`; `direction` is that of its phase."""

    meets_s: float
    meets_mm: float
    meets_c: float
    direction: int

    def is_over(self, time_s: float, hysteresis: HysteresisState, travel_mm: float) -> bool:
        """Whether the reference has come to the meeting point, or the wire is beyond it already."""
        beyond = self.direction * (hysteresis.y - self.meets_mm) / travel_mm
        return time_s >= self.meets_s or beyond > BEYOND


class ReversalPreview:
    """The decision above, for one wire."""

    def __init__(self, wire: WireModel) -> None:
        self._wire = wire
        self._inverse = InverseFeedforward(wire.model)
        self._horizon_s = HORIZON * wire.balance.time_constant_s

    def update(
        self, estimate: WireEstimate, reference: Reference, time_s: float, direction: int, limit_w: float
    ) -> Turn | None:
        """The turn to begin now, at `time_s`; None while the wire should go on in `direction` (of its phase)."""
        ahead = direction / self._wire.travel_mm
        turns_s = reference.next_turn_s(time_s, 1 if ahead > 0 else -1)
        if turns_s > time_s + 0.5 * self._horizon_s:
            return None
        step_s = self._horizon_s / POINTS
        early = late = 0.0
        meets_s = time_s
        for way_mm in self._way_mm(estimate, limit_w if direction < 0 else 0.0, step_s):
            meets_s += step_s
            short = ahead * (reference.value_mm(meets_s) - way_mm)
            if meets_s <= turns_s or (short > 0.0 and late == 0.0):
                early = max(early, short)
            elif short < 0.0:
                late = max(late, -short)
            else:
                break
        if late < early or late == 0.0 or early > MISSED:
            return None
        meets_s = max(meets_s, turns_s)
        meets_mm = reference.value_mm(meets_s)
        return Turn(meets_s, meets_mm, self._inverse.update(estimate.hysteresis, meets_mm).v, -direction)

    def _way_mm(self, estimate: WireEstimate, power_w: float, step_s: float) -> Iterator[float]:
        """Displacements of a wire that leaves with `power_w`."""
        state = WireState(estimate.temperature_c, estimate.hysteresis)
        for _ in range(POINTS):
            state = self._wire.step(state, power_w + estimate.disturbance_w, step_s)
            yield state.hysteresis.y
