"""The preview of reversals: it decides when the wire begins to cross its hysteresis, before the reference reverses.

At a reversal the temperature must change by many kelvin, from one branch to the other, and meanwhile the wire hardly
moves. The surroundings limit the cooling. A wire that reverses together with the reference is late by the whole time of
this crossing, so it has an error after the peak. A wire that reverses early does not reach the peak, so it has an error
before the peak. The preview begins the reversal when these two errors are equal: the larger error is then as small as
possible. To find this moment, the preview simulates a wire that begins to reverse now: at the least power if the wire
must cool, at full power if the wire must heat up. It compares the simulated wire with the reference at `POINTS` times.

A reference can pass its peak before a reversal is due, for example if it rests there for a moment. So for some time
after the peak, the reversal of a wire that would be late by more than `LATE` still begins.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

from smadrive.control.estimation.wire_estimate import WireEstimate
from smadrive.control.references.reference import Reference
from smadrive.hysteresis import HysteresisState, InverseFeedforward
from smadrive.wire.wire_model import WireModel, WireState

POINTS = 28
"""Number of points of the crossing at which the wire is compared with the reference."""

HORIZON = 0.6
"""Duration of the simulated crossing, in time constants of the wire."""

MISSED = 0.01
"""Largest allowed error before the peak, as a fraction of the stroke.

While the error would be larger, no reversal begins, even if the wire is then late, for example at a step.
"""

LATE = 0.0025
"""A reversal begins after the peak only if the wire would be late by more than this, as a fraction of the stroke.

A wire that has already reversed is late by less: by the noise of its estimate.
"""

BEYOND = 0.01
"""A wire that is beyond the meeting point by more than this fraction of the stroke has ended its reversal early."""


LEAST_PERIODS = 1.5
"""A reversal is previewed at least this number of periods of the loop before the peak."""


@dataclass(frozen=True, slots=True)
class Reversal:
    """A reversal that the wire has begun. At the time `meets_s` the wire meets the reference again.

    `meets_mm` and `meets_c` are displacement and temperature of this meeting point. `direction` is the direction after
    the reversal: +1 towards the hot end of the travel, -1 towards the cold end.
    """

    meets_s: float
    meets_mm: float
    meets_c: float
    direction: int

    def is_over(self, time_s: float, hysteresis: HysteresisState, travel_mm: float) -> bool:
        """Return True if the reversal has ended.

        It ends at `meets_s`, or when the wire has passed the displacement `meets_mm` by more than `BEYOND` strokes.
        """
        beyond = self.direction * (hysteresis.y - self.meets_mm) / travel_mm
        return time_s >= self.meets_s or beyond > BEYOND


class _Crossing(NamedTuple):
    """A simulated reversal that begins now.

    `meets_s` is the time at which the wire meets the reference. `early` and `late` are the largest errors before and
    after the peak of the reference, in strokes.
    """

    meets_s: float
    early: float
    late: float

    def is_due(self, tolerated: float) -> bool:
        """Return True if the reversal must begin now.

        Three conditions must be true. The error after the peak is larger than `tolerated`, in strokes. It is at least
        as large as the error before the peak, so that a later beginning would be worse. The error before the peak is at
        most `MISSED`.
        """
        return self.late > tolerated and self.late >= self.early and self.early <= MISSED


class ReversalPreview:
    """Decides when the reversals of one wire begin."""

    def __init__(self, wire: WireModel, period_s: float) -> None:
        """`period_s` is the period of the loop."""
        self._wire = wire
        self._inverse = InverseFeedforward(wire.model)
        self._horizon_s = HORIZON * wire.balance.time_constant_s
        self._seen_s = max(0.5 * self._horizon_s, LEAST_PERIODS * period_s)

    def update(
        self,
        estimate: WireEstimate,
        reference: Reference,
        time_s: float,
        direction: int,
        limits_w: tuple[float, float],
    ) -> Reversal | None:
        """Return the reversal that must begin now, at `time_s`, or None if the wire must follow the reference.

        `estimate` is the estimated state of the wire. `direction` is the direction of the reference: +1 towards the hot
        end of the travel, -1 towards the cold end. The wire reverses at the least power if it must cool, otherwise at
        the largest; `limits_w` are these two.
        """
        direction_mm = 1 if direction / self._wire.travel_mm > 0 else -1
        reverses_s = reference.next_reversal_s(time_s, direction_mm)
        if reverses_s <= time_s + self._seen_s:
            reversal = self._due(estimate, reference, time_s, reverses_s, direction, limits_w, tolerated=0.0)
            if reversal is not None:
                return reversal
        reversed_s = reference.next_reversal_s(time_s - self._seen_s, -direction_mm)
        if reversed_s > time_s:
            return None
        return self._due(estimate, reference, time_s, reversed_s, -direction, limits_w, tolerated=LATE)

    def _due(
        self,
        estimate: WireEstimate,
        reference: Reference,
        time_s: float,
        reverses_s: float,
        direction: int,
        limits_w: tuple[float, float],
        tolerated: float,
    ) -> Reversal | None:
        """Return the reversal that ends the movement in `direction`, or None if it is not due.

        `reverses_s` is the time of the peak, `tolerated` the largest error after it, in strokes.
        """
        power_w = limits_w[0] if direction > 0 else limits_w[1]
        crossing = _crossing(self._shortfalls(estimate, reference, time_s, direction, power_w), reverses_s)
        if not crossing.is_due(tolerated):
            return None
        meets_s = max(crossing.meets_s, reverses_s)
        meets_mm = reference.value_mm(meets_s)
        meets_c = self._inverse.update(estimate.hysteresis, meets_mm).v + estimate.shift_c
        return Reversal(meets_s, meets_mm, meets_c, -direction)

    def _shortfalls(
        self, estimate: WireEstimate, reference: Reference, time_s: float, direction: int, power_w: float
    ) -> Iterator[tuple[float, float]]:
        """Simulate a wire that reverses now. Yield times, each with the distance of wire and reference in strokes.

        The distance is positive while the wire falls short of the reference.
        """
        state = WireState(estimate.temperature_c, estimate.hysteresis)
        heated_w = power_w + estimate.disturbance_w
        step_s, ahead = self._horizon_s / POINTS, direction / self._wire.travel_mm
        for _ in range(POINTS):
            state = self._wire.step(state, heated_w, step_s)
            time_s += step_s
            yield time_s, ahead * (reference.value_mm(time_s) - state.hysteresis.y)


def _crossing(shortfalls: Iterable[tuple[float, float]], reverses_s: float) -> _Crossing:
    """Follow the wire until it meets the reference after the peak at `reverses_s`, and return the crossing.

    First the wire is too early: it falls short of the reference, until the reference has reversed and reached the wire.
    Then the wire is late, until it has caught up with the reference. A crossing that is too early is not followed on.
    """
    early = late = time_s = 0.0
    for time_s, short in shortfalls:
        if time_s <= reverses_s or (short > 0.0 and late == 0.0):
            early = max(early, short)
            if early > MISSED:
                break
        elif short < 0.0:
            late = max(late, -short)
        else:
            break
    return _Crossing(time_s, early, late)
