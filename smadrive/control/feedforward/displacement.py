"""Displacement → temperature: the inverse hysteresis on the estimated state of the wire.

The inverse starts from the estimated displacement, not from the setpoint. The wire keeps the direction of the
reference. If the estimate is a little ahead of the reference, the wire waits and does not reverse, because after a
reversal the temperature of a hysteretic wire must change by many kelvin before the wire moves. The wire reverses only
if the wait takes longer than the cooling, without power, from T₊ to T₋:

    (lead - tolerance) / rate of the reference  >  τ log((T₊ - T_amb) / (T₋ - T_amb))

T₋ is the temperature at which the cooling wire begins to move. T₊ is the temperature at which the heated wire begins to
move, or that of the wire itself if the reference rises. τ is the time constant; the heating takes far less time. While
the wire cools, both sides decrease by 1 s in each second, so the wire does not change its mind. The tolerance is
smaller for a wire that turns back already, because noise should not end what it has begun. A wire waits for every
reference that it leads by less than its tolerance. With a displacement sensor, the trim (controllers/trim.py) is part
of the reference: it takes a wire back that leads a reference at rest.

A wire at the cold end may have any lower temperature, so there T₋ is that of the end of its travel. Heat alone takes it
back to a falling reference. So it turns back even in surroundings that are too warm for it to cool to T₋.
"""

from __future__ import annotations

from collections.abc import Callable
from math import isfinite
from typing import NamedTuple, Protocol

from smadrive.hysteresis import HysteresisModel, HysteresisState, InverseFeedforward
from smadrive.wire.branch_temperatures import BranchTemperatures
from smadrive.wire.wire_model import travel_mm

REVERSAL_TOLERANCE = 0.01
"""Fraction of the stroke by which the estimate may lead the reference before the wire reverses."""

DECIDED = 0.002
"""The tolerance is smaller by this fraction of the stroke for a wire that turns back."""

WAITING_RANGE_C = 0.5
"""A waiting wire is at most this far behind the branch that it needs next, K: below it on heating, above on cooling."""

READY = 0.0003
"""The branch that a waiting wire needs next begins where the wire has moved by this fraction of the stroke."""

BACK = 0.001
"""A waiting wire moves back beyond the setpoint by at most this fraction of the stroke: the noise of a sensor."""

MOST_K = 200.0
"""Largest derivative of the temperature with respect to the phase, K: about 20 K in the middle of the loop.

At the foot of a branch it has no bound, so the slightest movement of the setpoint would request the largest power.
"""

COLD_END = 0.003
"""Up to this fraction of the stroke a sensor cannot distinguish the wire from a cold wire.

A setpoint in this range is that of a cold wire; see `COLDER_C`. Otherwise the noise of the estimate would heat the wire
again and again to the temperature at which its transformation begins, tens of kelvin above the cold wire.
"""

FOOT_S = 2.0
"""A cold wire is heated this long before it must move, s: about the time until its transformation begins."""

COLDER_C = 5.0
"""The target temperature of a cold wire is this far below the model's range, K: sensor noise then commands no heat.

If the range begins more than this above the ambient temperature, the wire is held at the target.
"""

BEYOND_C = 1.0
"""The target is at most this far above the heating branch at the setpoint, K: a stuck sensor would request ever more.
"""

CoolingTime = Callable[[float, float], float]
"""A function that returns the time in s in which the wire cools from one temperature to another."""


def at_once(from_c: float, to_c: float) -> float:  # noqa: ARG001
    """Return 0 s: the wire need not cool."""
    return 0.0


class TemperatureTarget(NamedTuple):
    """The temperature that a displacement setpoint needs, °C, and the displacement that the wire then has, mm.

    `k_per_mm` is the derivative of this temperature with respect to the setpoint, in K/mm. It is 0 if the temperature
    does not follow the setpoint. `reachable` is False if the wire cannot get nearer to the setpoint. `turns_back` is
    True if the wire turns back to a reference that it leads.
    """

    temperature_c: float
    k_per_mm: float
    displacement_mm: float
    reachable: bool = True
    turns_back: bool = False


class DisplacementInverse(Protocol):
    """The interface of an inverse: it computes the temperature that a displacement setpoint needs.

    `hysteretic` is True if this temperature differs between heating and cooling.
    """

    hysteretic: bool

    def target(
        self,
        state: HysteresisState,
        setpoint_mm: float,
        direction: int,
        rate_mm_per_s: float = 0.0,
        cooling_s: CoolingTime = at_once,
        *,
        turns_back: bool = False,
    ) -> TemperatureTarget:
        """Return the temperature that takes the wire from `state` to `setpoint_mm`.

        `direction` is the direction of the reference: +1 towards the hot end of the travel, -1 towards the cold end.
        `rate_mm_per_s` is the rate of the setpoint, `cooling_s` the cooling time between two inputs of the model.
        `turns_back` is that of the last target.
        """
        ...


class HysteresisInverse:
    """The exact inverse of a hysteresis model. A wire that is a little ahead of the reference waits.

    With a larger lead, the inverse lets the wire reverse.
    """

    hysteretic = True

    def __init__(self, model: HysteresisModel) -> None:
        self._model = model
        self._inverse = InverseFeedforward(model)
        self._cold_mm, hot_mm = travel_mm(model)
        self._travel_mm = hot_mm - self._cold_mm
        self._cold_end_mm = self._cold_mm + COLD_END * self._travel_mm
        self._branches = BranchTemperatures(model)

    def target(
        self,
        state: HysteresisState,
        setpoint_mm: float,
        direction: int,
        rate_mm_per_s: float = 0.0,
        cooling_s: CoolingTime = at_once,
        *,
        turns_back: bool = False,
    ) -> TemperatureTarget:
        """Return the temperature that takes the wire from `state` to `setpoint_mm`, or at which the wire waits.

        `direction` is the direction of the reference: +1 towards the hot end of the travel, -1 towards the cold end.
        `rate_mm_per_s` is the rate of the setpoint, `cooling_s` the cooling time between two temperatures. The wire
        waits for at most the time of a reversal; `turns_back` is that of the last target. An unreachable setpoint gives
        the end of the model's temperature range, and the derivative 0; for a cold wire see `COLDER_C`. The target is at
        most `BEYOND_C` above the heating branch at the setpoint.
        """
        soon = max(rate_mm_per_s / self._travel_mm, 0.0) * FOOT_S
        if (setpoint_mm - self._cold_mm) / self._travel_mm + soon <= COLD_END:
            return TemperatureTarget(self._model.input_range[0] - COLDER_C, 0.0, self._cold_mm, reachable=False)
        lead = direction * (state.y - setpoint_mm) / self._travel_mm
        toward = direction * rate_mm_per_s / self._travel_mm
        beyond = lead - REVERSAL_TOLERANCE + (DECIDED if turns_back else 0.0)
        if lead >= 0.0 and (beyond <= 0.0 or self._is_soon(state, beyond, toward, direction, cooling_s)):
            found = self._wait(state, lead, direction, setpoint_mm)
        else:
            found = self._reach(state, setpoint_mm)._replace(turns_back=lead > 0.0)
        hottest_c = self._branches.heating_c(setpoint_mm) + BEYOND_C
        return found if found.temperature_c <= hottest_c else found._replace(temperature_c=hottest_c, k_per_mm=0.0)

    def _is_soon(
        self, state: HysteresisState, beyond: float, toward: float, direction: int, cooling_s: CoolingTime
    ) -> bool:
        """Return True if the reference makes up the lead sooner than a reversal, as at the head of this file.

        `beyond` is the lead without the tolerance, in strokes, and `toward` the rate at which the reference approaches
        the wire, in strokes per s.
        """
        if toward <= 0.0:
            return False
        moved_mm = READY * self._travel_mm
        warm_c = state.v if direction > 0 else self._inverse.update(state, state.y + moved_mm).v
        cold_c = max(self._inverse.update(state, state.y - moved_mm).v, self._branches.cooling_c(self._cold_end_mm))
        reversal_s = cooling_s(warm_c, cold_c)
        return beyond / toward <= reversal_s and (direction > 0 or isfinite(reversal_s))

    def _reach(self, state: HysteresisState, setpoint_mm: float) -> TemperatureTarget:
        """Return the temperature at which the wire reaches the setpoint."""
        inversion = self._inverse.update(state, setpoint_mm)
        slope = self._model.slope(inversion.state, 1 if inversion.v >= state.v else -1)
        k_per_mm = self._k_per_mm(slope / self._travel_mm) if inversion.reachable else 0.0
        return TemperatureTarget(inversion.v, k_per_mm, inversion.y, inversion.reachable)

    def _k_per_mm(self, per_k: float) -> float:
        """Return dT/dy in K/mm for the slope `per_k` of the phase, 1/K. dT/dξ is at most `MOST_K`."""
        return min(1.0 / per_k, MOST_K) / self._travel_mm if per_k > 0.0 else 0.0

    def _wait(self, state: HysteresisState, lead: float, direction: int, setpoint_mm: float) -> TemperatureTarget:
        """Return a target a little behind the branch of `direction`, where the wire waits for the reference.

        A wire between the branches hardly moves with its temperature. So it waits where it can move on at once: next to
        the branch that the reference needs. At an end of its travel it waits next to the end of this branch.
        """
        phase = (state.y - self._cold_mm) / self._travel_mm
        if not COLD_END < phase < 1.0 - COLD_END:
            waiting_c = self._waiting_c(state, direction, is_cold=phase < 0.5)
            return TemperatureTarget(waiting_c, 0.0, state.y, reachable=False)
        ready = self._inverse.update(state, state.y + direction * READY * self._travel_mm)
        per_k = self._model.slope(ready.state, direction) / self._travel_mm
        back_k = READY / per_k if per_k * WAITING_RANGE_C > READY else 0.0
        follows = lead < per_k * WAITING_RANGE_C
        target_c = ready.v - direction * (back_k + (lead / per_k if follows else WAITING_RANGE_C))
        back_per_k = self._model.slope(state, -direction) / self._travel_mm
        if direction * (state.v - target_c) * back_per_k > lead + BACK:
            return TemperatureTarget(state.v - direction * (lead + BACK) / back_per_k, 0.0, setpoint_mm)
        return TemperatureTarget(target_c, self._k_per_mm(per_k) if follows else 0.0, setpoint_mm)

    def _waiting_c(self, state: HysteresisState, direction: int, *, is_cold: bool) -> float:
        """Return the temperature at which a wire waits at an end of its travel. A cold wire that falls gets no heat."""
        end_mm = self._cold_end_mm if is_cold else self._cold_mm + self._travel_mm * (1.0 - COLD_END)
        if direction > 0:
            return self._branches.heating_c(end_mm) - WAITING_RANGE_C
        waiting_c = self._branches.cooling_c(end_mm) + WAITING_RANGE_C
        return min(waiting_c, state.v) if is_cold else waiting_c
