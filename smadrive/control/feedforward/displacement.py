"""Displacement → temperature → power: the inverse feedforward on the estimated state of the wire.

The inverse starts from the estimated displacement, not from the setpoint. The wire keeps the direction of the
reference. If the estimate is a little ahead of the reference, the wire waits and does not reverse, because after a
reversal the temperature of a hysteretic wire must change by many kelvin before the wire moves. The wire reverses only
for a large lead: the lead must exceed `REVERSAL_TOLERANCE` even after the reference has moved on for `REVERSAL_S`. For
a smaller lead, two reversals would take longer than the wait.
"""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import isotonic_regression

from smadrive.control.estimation.observer import WireEstimate
from smadrive.errors import DataError
from smadrive.hysteresis import HysteresisModel, HysteresisState, InverseFeedforward
from smadrive.numerics.piecewise_linear import PiecewiseLinear
from smadrive.wire.wire_model import WireModel, travel_mm

REVERSAL_TOLERANCE = 0.01
"""Fraction of the stroke by which the estimate may lead the reference before the wire reverses."""

REVERSAL_S = 1.0
"""Approximate time in which a wire crosses its hysteresis to the other branch and back, s."""

WAITING_RANGE_C = 0.5
"""A waiting wire is at most this far behind the branch that it needs next, K: below it on heating, above on cooling."""

READY = 0.0003
"""The branch that a waiting wire needs next begins where the wire has moved by this fraction of the stroke."""

MOST_K = 200.0
"""Largest derivative of the temperature with respect to the phase, K.

In the middle of the loop this derivative is about 20 K. At the foot of a branch, where the wire begins to move, it has
no bound: without this limit the slightest movement of the setpoint would request the largest power.
"""

COLD_END = 0.003
"""Up to this fraction of the stroke a sensor cannot distinguish the wire from a cold wire.

A setpoint in this range needs no heat. Otherwise the noise of the estimate would heat the wire again and again to the
temperature at which its transformation begins, tens of kelvin above the cold wire.
"""

FOOT_S = 2.0
"""A cold wire is heated this long before it must move, s: about the time until its transformation begins."""

COLDER_C = 5.0
"""The target temperature of a cold wire is this far below the model's range, K: sensor noise then commands no heat."""

BRANCH_POINTS = 2000
"""Number of points in the table of the heating branch."""

BEYOND_C = 1.0
"""The target is at most this far above the heating branch at the setpoint, K.

No state needs more. Without this limit, a stuck displacement sensor would request a higher and higher temperature.
"""

MAP_LEVELS = 50
"""Entries of the static map, about as many as in a table that is made by hand."""


class TemperatureTarget(NamedTuple):
    """The temperature that a displacement setpoint needs, °C, and the displacement that the wire then has, mm.

    `k_per_mm` is the derivative of this temperature with respect to the setpoint, in K/mm. It is 0 if the temperature
    does not follow the setpoint.
    """

    temperature_c: float
    k_per_mm: float
    displacement_mm: float


class DisplacementInverse(Protocol):
    """The interface of an inverse: it computes the temperature that a displacement setpoint needs.

    `hysteretic` is True if this temperature differs between heating and cooling.
    """

    hysteretic: bool

    def target(
        self, state: HysteresisState, setpoint_mm: float, direction: int, rate_mm_per_s: float = 0.0
    ) -> TemperatureTarget:
        """Return the temperature that takes the wire from `state` to `setpoint_mm`.

        `direction` is the direction of the reference: +1 towards the hot end of the travel, -1 towards the cold end.
        `rate_mm_per_s` is the rate of the setpoint.
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
        heated_c = np.linspace(*model.input_range, BRANCH_POINTS)
        phases = (model.simulate(heated_c) - self._cold_mm) / self._travel_mm
        self._hottest_c = PiecewiseLinear(np.maximum.accumulate(phases), heated_c + BEYOND_C)

    def target(
        self, state: HysteresisState, setpoint_mm: float, direction: int, rate_mm_per_s: float = 0.0
    ) -> TemperatureTarget:
        """Return the temperature that takes the wire from `state` to `setpoint_mm`, or at which the wire waits.

        `direction` is the direction of the reference: +1 towards the hot end of the travel, -1 towards the cold end.
        `rate_mm_per_s` is the rate of the setpoint. An unreachable setpoint gives the end of the model's temperature
        range, and the derivative 0; for a cold wire see `COLDER_C`. The target is at most `BEYOND_C` above the heating
        branch at the setpoint.
        """
        soon = max(rate_mm_per_s / self._travel_mm, 0.0) * FOOT_S
        if (setpoint_mm - self._cold_mm) / self._travel_mm + soon <= COLD_END:
            return TemperatureTarget(self._model.input_range[0] - COLDER_C, 0.0, self._cold_mm)
        lead = direction * (state.y - setpoint_mm) / self._travel_mm
        made_up = max(direction * rate_mm_per_s / self._travel_mm * REVERSAL_S, 0.0)
        if 0.0 <= lead <= REVERSAL_TOLERANCE + made_up:
            found = self._wait(state, lead, direction, setpoint_mm)
        else:
            found = self._reach(state, setpoint_mm)
        hottest_c = self._hottest_c.at((setpoint_mm - self._cold_mm) / self._travel_mm)
        return found if found.temperature_c <= hottest_c else found._replace(temperature_c=hottest_c, k_per_mm=0.0)

    def _reach(self, state: HysteresisState, setpoint_mm: float) -> TemperatureTarget:
        """Return the temperature at which the wire reaches the setpoint."""
        inversion = self._inverse.update(state, setpoint_mm)
        reached = self._model.step(state, inversion.v)
        slope = self._model.slope(reached, 1 if inversion.v >= state.v else -1)
        k_per_mm = self._k_per_mm(slope / self._travel_mm) if inversion.reachable else 0.0
        return TemperatureTarget(inversion.v, k_per_mm, reached.y)

    def _k_per_mm(self, per_k: float) -> float:
        """Return the derivative of the temperature with respect to the displacement, K/mm.

        `per_k` is the slope of the phase, 1/K. The derivative with respect to the phase is at most `MOST_K`.
        """
        return min(1.0 / per_k, MOST_K) / self._travel_mm if per_k > 0.0 else 0.0

    def _wait(self, state: HysteresisState, lead: float, direction: int, setpoint_mm: float) -> TemperatureTarget:
        """Return a target a little behind the branch of `direction`, where the wire waits for the reference.

        A wire between the branches hardly moves with its temperature. So it waits where it can move on at once: next to
        the branch that the reference needs. A wire at an end of its travel waits near its present temperature.
        """
        if not COLD_END < (state.y - self._cold_mm) / self._travel_mm < 1.0 - COLD_END:
            return TemperatureTarget(state.v - direction * WAITING_RANGE_C, 0.0, state.y)
        ready_c = self._inverse.update(state, state.y + direction * READY * self._travel_mm).v
        per_k = self._model.slope(self._model.step(state, ready_c), direction) / self._travel_mm
        back_k = READY / per_k if per_k * WAITING_RANGE_C > READY else 0.0
        if lead >= per_k * WAITING_RANGE_C:
            return TemperatureTarget(ready_c - direction * (back_k + WAITING_RANGE_C), 0.0, setpoint_mm)
        target_c = ready_c - direction * (back_k + lead / per_k)
        return TemperatureTarget(target_c, self._k_per_mm(per_k), setpoint_mm)


class StaticMap:
    """A static temperature map: the displacement is a monotone function of the temperature, without hysteresis.

    The map is fitted to a record by isotonic regression and tabulated at `MAP_LEVELS` displacements. It runs about
    midway between the branches, like a calibration table. Comparisons use it as the baseline for the inverse
    feedforward.
    """

    hysteretic = False

    def __init__(self, temperature_c: ArrayLike, displacement_mm: ArrayLike) -> None:
        temperature = np.asarray(temperature_c, dtype=np.float64)
        displacement = np.asarray(displacement_mm, dtype=np.float64)
        if temperature.shape != displacement.shape or temperature.size < 2:
            raise DataError(
                "needs two columns of the same length, with 2 samples at least",
                where="static map",
                value=(temperature.shape, displacement.shape),
            )
        order = np.argsort(temperature, kind="stable")
        rising = np.corrcoef(temperature, displacement)[0, 1] >= 0
        fit = isotonic_regression(displacement[order], increasing=bool(rising))
        level, first = np.unique(fit.x, return_index=True)
        self._displacement_mm = np.linspace(level[0], level[-1], MAP_LEVELS)
        self._temperature_c: NDArray[np.float64] = np.interp(self._displacement_mm, level, temperature[order][first])

    def target(
        self,
        state: HysteresisState,
        setpoint_mm: float,
        direction: int,  # noqa: ARG002
        rate_mm_per_s: float = 0.0,  # noqa: ARG002
    ) -> TemperatureTarget:
        """Return the temperature of the map at `setpoint_mm`; the history of the wire has no effect.

        Outside the displacements of the map, the result is the temperature at the end of the map, with the derivative
        0.
        """
        at = int(np.searchsorted(self._displacement_mm, setpoint_mm))
        if not 0 < at < MAP_LEVELS:
            return TemperatureTarget(float(self._temperature_c[min(at, MAP_LEVELS - 1)]), 0.0, state.y)
        (y0, y1), (t0, t1) = self._displacement_mm[at - 1 : at + 1], self._temperature_c[at - 1 : at + 1]
        k_per_mm = float((t1 - t0) / (y1 - y0))
        return TemperatureTarget(float(t0) + k_per_mm * (setpoint_mm - float(y0)), k_per_mm, state.y)


class Feedforward(NamedTuple):
    """The setpoint of the wire temperature, the power for it, and the displacement that the wire then has."""

    temperature_c: float
    power_w: float
    displacement_mm: float


class DisplacementFeedforward:
    """Computes temperature (by the inverse hysteresis) and power (by the inverse heat balance) for a displacement."""

    def __init__(self, inverse: DisplacementInverse, wire: WireModel) -> None:
        self._inverse = inverse
        self._travel_mm = wire.travel_mm
        self._balance = wire.balance

    def update(self, estimate: WireEstimate, setpoint_mm: float, rate_mm_per_s: float, direction: int) -> Feedforward:
        """Return temperature setpoint and power for the displacement `setpoint_mm`, which moves at `rate_mm_per_s`.

        `estimate` is the estimated state of the wire. Its `shift_c` is added to the temperature of the inverse, and its
        `disturbance_w` is subtracted from the power. `direction` is the direction of the reference: +1 towards the hot
        end of the travel, -1 towards the cold end.
        """
        target = self._inverse.target(estimate.hysteresis, setpoint_mm, direction, rate_mm_per_s)
        rate_c_per_s = target.k_per_mm * rate_mm_per_s
        temperature_c = target.temperature_c + estimate.shift_c
        power_w = self._balance.power_w(temperature_c, rate_c_per_s, rate_mm_per_s / self._travel_mm)
        return Feedforward(temperature_c, power_w - estimate.disturbance_w, target.displacement_mm)

    def hold(self, estimate: WireEstimate, temperature_c: float, displacement_mm: float) -> Feedforward:
        """Return the given setpoints of temperature and displacement, and the power that holds the wire there."""
        power_w = self._balance.power_w(temperature_c, 0.0, 0.0) - estimate.disturbance_w
        return Feedforward(temperature_c, power_w, displacement_mm)
