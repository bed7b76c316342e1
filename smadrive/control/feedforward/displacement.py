"""Displacement → temperature → power: the inverse feedforward on the estimated state of the wire.

The inverse starts from where the observer believes the wire to be, not from where it was meant to be. Its direction is
that of the reference: an estimate a hair ahead of the reference must make the wire wait, not turn back, because after
a turning point a hysteretic wire answers only many kelvin later. Only a lead turns it that exceeds `REVERSAL_TOLERANCE`
by more than the reference makes up for within `REVERSAL_S`: to go and come back would take longer.
"""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import isotonic_regression

from smadrive.control.estimation.observer import WireEstimate
from smadrive.errors import DataError
from smadrive.hysteresis import HysteresisModel, HysteresisState, InverseFeedforward
from smadrive.wire.wire_model import WireModel, travel_mm

REVERSAL_TOLERANCE = 0.01
"""Fraction of the stroke by which the estimate may lead the reference before the wire is driven back."""

REVERSAL_S = 1.0
"""About what it takes a wire to cross its hysteresis and come back."""

WAITING_RANGE_C = 0.5
"""How far below (above) its present temperature a wire that leads the reference is held while it waits, K."""

COLD_END = 0.003
"""Up to this fraction of the stroke no sensor tells a wire from a cold one, and every cold wire is there.

Held at such a displacement, or about to be, it needs no heat; by the noise of its estimate it would be driven to the
foot of its branch, tens of kelvin away, again and again.
"""

FOOT_S = 2.0
"""About what it takes a cold wire to come to the foot of its branch: so long before it is to move, it is heated."""

COLDER_C = 5.0
"""So far below the model's range is a cold wire wanted: no noise of its thermometer then asks for heat, K."""

MAP_LEVELS = 50
"""Entries of the plain map: a table, as one would write it down."""


class TemperatureTarget(NamedTuple):
    """The temperature for a displacement, and how it moves with the displacement there (0 where it is held)."""

    temperature_c: float
    k_per_mm: float


class DisplacementInverse(Protocol):
    """Anything that tells the temperature for a wanted displacement; `hysteretic` if it knows of two branches."""

    hysteretic: bool

    def target(
        self, state: HysteresisState, setpoint_mm: float, direction: int, rate_mm_per_s: float = 0.0
    ) -> TemperatureTarget:
        """Where the wire stands at `setpoint_mm`, coming from `state` in `direction` (+1: the phase rises).

        `rate_mm_per_s` is how fast the wanted displacement moves on.
        """
        ...


class HysteresisInverse:
    """The exact inverse of a hysteresis model, with the direction rule above."""

    hysteretic = True

    def __init__(self, model: HysteresisModel) -> None:
        self._model = model
        self._inverse = InverseFeedforward(model)
        self._cold_mm, hot_mm = travel_mm(model)
        self._travel_mm = hot_mm - self._cold_mm

    def target(
        self, state: HysteresisState, setpoint_mm: float, direction: int, rate_mm_per_s: float = 0.0
    ) -> TemperatureTarget:
        """See DisplacementInverse; what is out of reach gives the end of the model's range, held."""
        soon = max(rate_mm_per_s / self._travel_mm, 0.0) * FOOT_S
        if (setpoint_mm - self._cold_mm) / self._travel_mm + soon <= COLD_END:
            return TemperatureTarget(self._model.input_range[0] - COLDER_C, 0.0)
        lead = direction * (state.y - setpoint_mm) / self._travel_mm
        made_up = max(direction * rate_mm_per_s / self._travel_mm * REVERSAL_S, 0.0)
        if 0.0 <= lead <= REVERSAL_TOLERANCE + made_up:
            return self._wait(state, lead, direction)
        inversion = self._inverse.update(state, setpoint_mm)
        reached = self._model.step(state, inversion.v)
        slope = self._model.slope(reached, 1 if inversion.v >= state.v else -1)
        return TemperatureTarget(inversion.v, 1.0 / slope if inversion.reachable and slope else 0.0)

    def _wait(self, state: HysteresisState, lead: float, direction: int) -> TemperatureTarget:
        """A little behind the state, along its own branch, until the reference has caught up."""
        per_k = self._model.slope(state, direction) / self._travel_mm
        if lead >= per_k * WAITING_RANGE_C:
            return TemperatureTarget(state.v - direction * WAITING_RANGE_C, 0.0)
        return TemperatureTarget(state.v - direction * lead / per_k, 1.0 / (per_k * self._travel_mm))


class StaticMap:
    """The plain temperature map: displacement as a single-valued monotone function of temperature, no hysteresis.

    Fitted to the same record by isotonic regression and tabulated at `MAP_LEVELS` displacements, it runs midway between
    the branches: what a calibration table would do, and the baseline that the inverse feedforward is compared with.
    """

    hysteretic = False

    def __init__(self, temperature_c: ArrayLike, displacement_mm: ArrayLike) -> None:
        temperature = np.asarray(temperature_c, dtype=np.float64)
        displacement = np.asarray(displacement_mm, dtype=np.float64)
        if temperature.shape != displacement.shape or temperature.size < 2:
            raise DataError("static map: needs two columns of one length >= 2")
        order = np.argsort(temperature, kind="stable")
        rising = np.corrcoef(temperature, displacement)[0, 1] >= 0
        fit = isotonic_regression(displacement[order], increasing=bool(rising))
        level, first = np.unique(fit.x, return_index=True)
        self._displacement_mm = np.linspace(level[0], level[-1], MAP_LEVELS)
        self._temperature_c: NDArray[np.float64] = np.interp(self._displacement_mm, level, temperature[order][first])

    def target(
        self,
        state: HysteresisState,  # noqa: ARG002
        setpoint_mm: float,
        direction: int,  # noqa: ARG002
        rate_mm_per_s: float = 0.0,  # noqa: ARG002
    ) -> TemperatureTarget:
        """The map's temperature, whatever the wire's history."""
        at = int(np.searchsorted(self._displacement_mm, setpoint_mm))
        if not 0 < at < MAP_LEVELS:
            return TemperatureTarget(float(self._temperature_c[min(at, MAP_LEVELS - 1)]), 0.0)
        (y0, y1), (t0, t1) = self._displacement_mm[at - 1 : at + 1], self._temperature_c[at - 1 : at + 1]
        k_per_mm = float((t1 - t0) / (y1 - y0))
        return TemperatureTarget(float(t0) + k_per_mm * (setpoint_mm - float(y0)), k_per_mm)


class Feedforward(NamedTuple):
    """Wanted wire temperature and the power that follows it."""

    temperature_c: float
    power_w: float


class DisplacementFeedforward:
    """Wanted displacement and its rate → wanted temperature and power (inverse heat balance)."""

    def __init__(self, inverse: DisplacementInverse, wire: WireModel) -> None:
        self._inverse = inverse
        self._travel_mm = wire.travel_mm
        self._balance = wire.balance

    def update(self, estimate: WireEstimate, setpoint_mm: float, rate_mm_per_s: float, direction: int) -> Feedforward:
        """The feedforward for a wire that is to be at `setpoint_mm`, moving on at `rate_mm_per_s`.

        `direction` is that in which the phase is to go (+1: it rises).
        """
        target = self._inverse.target(estimate.hysteresis, setpoint_mm, direction, rate_mm_per_s)
        rate_c_per_s = target.k_per_mm * rate_mm_per_s
        power_w = self._balance.power_w(target.temperature_c, rate_c_per_s, rate_mm_per_s / self._travel_mm)
        return Feedforward(target.temperature_c, power_w - estimate.disturbance_w)

    def hold(self, estimate: WireEstimate, temperature_c: float) -> Feedforward:
        """The feedforward for a wire that is to go to a temperature and stay."""
        return Feedforward(temperature_c, self._balance.power_w(temperature_c, 0.0, 0.0) - estimate.disturbance_w)
