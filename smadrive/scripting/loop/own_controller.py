"""A controller of the user in the loop: its duration, its commands and the time of `update` are checked.

The loop waits for `update`. On a device in real time, a slow `update` looks like a lost connection: no measurement
arrives, and the supervisor advises to check the cable. So the time of `update` is measured, and named as the cause.
"""

from __future__ import annotations

import inspect
import time
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from math import inf, isfinite
from typing import Any, NamedTuple

from smadrive.control.controllers.interface import Command
from smadrive.errors import ConfigError, ControllerError
from smadrive.measurement import Measurement
from smadrive.numerics.scalars import real_number
from smadrive.scripting.loop.messages import ScriptEndedError

FAR_BEYOND = 20.0
"""A commanded current above this multiple of current_max_a is an error, for example a current in milliamperes.

A current between current_max_a and this multiple is clamped, because a controller with a large gain may command it.
"""

FASTER = "make update faster than the period, or lower rate_hz in the rig file"

RETURN_A_COMMAND = "return smadrive.Command(commanded_a=…) from update"


class Pace(NamedTuple):
    """The times that a rig allows: the period of its loop, and the longest time without a measurement, both in s.

    `is_virtual` is True for a rig in virtual time. Such a rig waits for `update` without a limit.
    """

    period_s: float = inf
    longest_s: float = inf
    is_virtual: bool = False


UNTIMED = Pace()


class OwnController:
    """A controller for the loop, around any object with `update(time_s, measurement, dt_s) -> Command`.

    The run lasts `duration_s` or, if this is None, as long as the attribute `duration_s` of the object says.
    ControllerError when `update` returns no command, or commands a current that is not finite or is above `FAR_BEYOND`
    times `current_max_a`; in real time also when `update` takes longer than `pace.longest_s`. Other errors of `update`
    pass unchanged, but a SystemExit becomes a ControllerError. `update` runs inside `at_once`, so an interruption may
    end it at any place. `now_s` returns the real time. `slowest_s` is the longest time that `update` has taken.
    """

    def __init__(
        self,
        controller: Any,
        duration_s: float | None,
        current_max_a: float,
        at_once: Callable[[], AbstractContextManager[None]] = nullcontext,
        pace: Pace = UNTIMED,
        now_s: Callable[[], float] = time.monotonic,
    ) -> None:
        self.controller = controller
        self.slowest_s = 0.0
        self._pace = pace
        self._now_s = now_s
        self._at_once = at_once
        self._duration_s = duration_s
        self._current_max_a = current_max_a

    @property
    def name(self) -> str:
        """The name of the controller's class."""
        return type(self.controller).__qualname__

    @property
    def duration_s(self) -> float:
        """Duration of the run, s. If the controller gives it as its attribute, it may change during the run."""
        return self._duration_s if self._duration_s is not None else float(self.controller.duration_s)

    def update(self, time_s: float, measurement: Measurement, dt_s: float) -> Command:
        """Return the checked command of the controller."""
        begun_s = self._now_s()
        try:
            with self._at_once():
                command = self.controller.update(time_s, measurement, dt_s)
        except ScriptEndedError:
            raise
        except SystemExit:
            raise ControllerError("update called exit", where=self.name, cure="raise an error instead") from None
        self._check_time(self._now_s() - begun_s)
        if not isinstance(command, Command):
            what = "update returned something else than a command"
            raise ControllerError(what, where=self.name, value=_shown(command), cure=RETURN_A_COMMAND)
        numbers = Command(*(self._number(name, value) for name, value in command._asdict().items()))
        self._check_current(numbers.commanded_a)
        return numbers

    @property
    def caveats(self) -> tuple[str, ...]:
        """One sentence if `update` was slow, otherwise empty.

        Slow means longer than the period in real time. In virtual time it means that a rig in real time would trip.
        """
        pace = self._pace
        if self.slowest_s <= (pace.longest_s if pace.is_virtual else pace.period_s):
            return ()
        took = f"update of {self.name} took up to {self.slowest_s:.2g} s, and the period is {pace.period_s:g} s"
        return (f"{took}: on a rig in real time the run would trip" if pace.is_virtual else f"{took}: {FASTER}",)

    def _check_time(self, took_s: float) -> None:
        self.slowest_s = max(self.slowest_s, took_s)
        if took_s > self._pace.longest_s and not self._pace.is_virtual:
            raise ControllerError(
                "update took too long",
                where=self.name,
                value=f"{took_s:.2g} s",
                limit=f"{self._pace.longest_s:g} s without a measurement; the period is {self._pace.period_s:g} s",
                cure=FASTER,
            )

    def _check_current(self, current_a: float) -> None:
        if not isfinite(current_a):
            what = "the commanded current is not a finite number"
            raise ControllerError(what, where=self.name, value=current_a, cure="check how update computes the current")
        if current_a > FAR_BEYOND * self._current_max_a:
            raise ControllerError(
                "the commanded current is far beyond the limit of the rig",
                where=self.name,
                value=f"{current_a:g} A",
                limit=f"current_max_a = {self._current_max_a:g} A",
                cure="command the current in amperes, and limit it in update",
            )

    def _number(self, name: str, value: object) -> float:
        """Return the field `name` of a command as a float. ControllerError when `value` is not a number."""
        return real_number(value, f"{self.name}, {name} of the command", ControllerError)


def check_controller(controller: object, duration_s: object) -> None:
    """Raise ConfigError if the object is not a controller, or if the length of its run is unknown."""
    name = type(controller).__qualname__
    if isinstance(controller, type):
        raise ConfigError(
            "a class, not an object",
            where="controller",
            value=controller.__qualname__,
            cure="call the class, and pass the object",
        )
    update = getattr(controller, "update", None)
    if not callable(update):
        cure = "give it update(time_s, measurement, dt_s), which returns a smadrive.Command"
        raise ConfigError("not a controller", where="controller", value=name, cure=cure)
    if not _takes_three(update):
        cure = "give update the arguments (self, time_s, measurement, dt_s)"
        raise ConfigError("update does not take three arguments", where="controller", value=name, cure=cure)
    given = getattr(controller, "duration_s", None) if duration_s is None else duration_s
    if given is None:
        cure = "pass duration_s=…, or give the controller this attribute"
        raise ConfigError("the length of the run is unknown", where="duration_s", value=name, cure=cure)
    if not _is_duration(given):
        cure = "give it in seconds; math.inf runs until it is interrupted"
        raise ConfigError("not a positive number", where="duration_s", value=_shown(given), cure=cure)


def _takes_three(update: Callable[..., Any]) -> bool:
    """Return False if a call with three arguments is sure to fail; True also for a function without a signature."""
    try:
        inspect.signature(update).bind(0.0, None, 0.0)
    except TypeError:
        return False
    except ValueError:
        return True
    return True


def _is_duration(value: Any) -> bool:
    try:
        return real_number(value, "duration_s") > 0  # false for NaN
    except ConfigError:
        return False


def _shown(value: object) -> str:
    """Return a short text of any value, even if its repr raises an error."""
    try:
        text = repr(value)
    except Exception:  # noqa: BLE001 (the user's own class)
        return type(value).__qualname__
    return text if len(text) <= 60 else f"{text[:60]}…"
