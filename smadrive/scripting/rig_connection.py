"""The connection of a script to its loop process and to the rig that this process has opened."""

from __future__ import annotations

import sys
import threading
import weakref
from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from smadrive.display.ascii_text import ascii_text
from smadrive.display.card import card
from smadrive.errors import BusyError, ConfigError, SafetyError
from smadrive.rig.config import RigConfig
from smadrive.safety.shutdown import ShutdownOutcome, carry, shutdown_of
from smadrive.scripting.callbacks import is_callback
from smadrive.scripting.loop.client.loop_client import LoopClient
from smadrive.scripting.loop.messages import CloseRequest, OpenedRig, OpenRequest
from smadrive.scripting.servo import Servo

_clients: weakref.WeakSet[LoopClient] = weakref.WeakSet()
"""The clients of this script."""


class RigConnection:
    """Opens the rig of `config` in a new loop process. A context manager that switches the heater off at its end.

    `quantities` are the quantities that the rig measures, such as "displacement".
    """

    def __init__(self, config: RigConfig) -> None:
        self.config = config
        self._servo: Servo | None = None
        self._one_close, self._one_servo = threading.RLock(), threading.RLock()
        self._is_closed = False
        self._close_error: Exception | None = None
        self._client = LoopClient()
        _clients.add(self._client)
        self._finalizer = weakref.finalize(self, self._client.end)
        try:
            opened: OpenedRig = self._client.call(OpenRequest(config, tuple(sys.path)))
        except BaseException as error:
            self._finalizer()
            if isinstance(error, BusyError) and _is_of_this_script(error):
                raise _busy(error.where) from None
            raise
        self._identities, self.is_virtual, self.quantities = opened

    def __enter__(self) -> Self:
        """Return the open rig."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close the rig. An error in the `with` block is raised again, and a failure to close becomes its note.

        In a forked child nothing happens: the rig stays open in its parent.
        """
        if not self._client.owner.is_present:
            return
        if error is None:
            self.close()
            return
        try:
            self.close()
        except Exception as lost:  # noqa: BLE001 (the outcome becomes a note of the error that is raised)
            if lost is not error:
                carry(error, shutdown_of(lost) or ShutdownOutcome(lost))

    @property
    def is_open(self) -> bool:
        """True until `close` is called."""
        return self._finalizer.alive

    def close(self) -> None:
        """End what runs, also in another thread, switch the heater off, and end the loop process.

        Raises an error if the heater is not confirmed off. StoppedError if `smadrive off` has stopped the loop process
        and no call of this thread has raised this error before. In a callback of the servo, MotionError: the servo
        stops, and the rig stays open. ConfigError in a forked child.
        """
        if self._is_closed:
            return
        self._check_may_switch_off()
        with self._one_close:
            self._close()

    def _check_may_switch_off(self) -> None:
        """Raise an error if this thread must not wait until the heater is off. In a callback, the servo stops first."""
        self._client.owner.check()
        if is_callback():
            self._stop_servo()
        self._client.check_may_call()

    def _close(self) -> None:
        """Close the rig, or raise the error of another thread that has meanwhile failed to close it."""
        if self._close_error is not None:
            raise self._close_error
        if not self.is_open:
            return
        try:
            self._end_all(self._request_close)
        except BaseException as error:
            self._close_error = _for_others(error)
            raise
        finally:
            self._finalizer()
            self._is_closed = True

    def _request_close(self) -> bool:
        if self._client.child.is_error_raised:
            return False
        self._client.call(CloseRequest())
        return True

    def _end_all(self, switch_off: Callable[[], bool]) -> None:
        """End the servo and the runs of other threads, then call `switch_off`, which confirms the heater off.

        An error of the servo is raised after `switch_off`. After an interruption all runs end, too.
        """
        servo = self._servo if self._servo is not None and self._servo.is_running else None
        with self._client.turns.others_ended(self._request_servo_end):
            try:
                if servo is not None:
                    servo.stop()
            except BaseException as error:
                switch_off_after(error, self._stop_servo)  # an interruption may have come before its command
                switch_off_after(error, switch_off)
                raise
            switch_off()

    def _request_servo_end(self) -> None:
        if self._servo is not None and self._servo.is_running:
            self._servo.request_end()

    def _stop_servo(self) -> bool:
        """Stop the servo, if one runs. Return True if the end of its run has confirmed the heater off."""
        if self._servo is None or not self._servo.is_running:
            return False
        self._servo.stop()
        return True

    def _call(self, request: Any) -> Any:
        self._check_free()
        return self._client.call(request)

    def _check_open(self) -> None:
        self._client.owner.check()
        if not self.is_open:
            raise ConfigError("the rig is closed", where=f"rig '{self.config.name}'", cure="open it again")

    def _check_free(self) -> None:
        """Raise ConfigError if the rig is closed, or if a servo uses it."""
        self._check_open()
        if self._servo is not None and self._servo.is_running:
            where, cure = f"rig '{self.config.name}'", "call stop() of the servo first"
            raise ConfigError("a servo uses the rig", where=where, cure=cure)

    def facts(self) -> list[tuple[str, str]]:
        """Return the main facts: names and values with units."""
        limits = self.config.limits
        return [
            *((f"device {name}", identity) for name, identity in self._identities.items()),
            ("wire", Path(self.config.wire).name.removesuffix(".toml")),
            ("rate", f"{self.config.rate_hz:g} Hz{' in virtual time' if self.is_virtual else ''}"),
            ("limits", f"{limits.current_max_a:g} A, {limits.temperature_max_c:g} °C"),
            ("state", self._state),
        ]

    @property
    def _state(self) -> str:
        if not self.is_open:
            return "closed"
        owner = self._client.owner
        if not owner.is_present:
            return f"open in process {owner.pid}"
        if self._client.ending:
            return self._client.ending
        if self._servo is not None and self._servo.is_running:
            return "open, a servo controls the heater"
        return "open, busy with a request" if self._client.is_busy else "open, idle"

    def __repr__(self) -> str:
        facts = ", ".join(f"{name} {value}" for name, value in self.facts())
        return ascii_text(f"{type(self).__name__}({self.config.name}, {facts})")

    def _repr_html_(self) -> str:
        return card(f"Rig: {self.config.name}", self.facts())


def switch_off_after(error: BaseException, switch_off: Callable[[], bool]) -> None:
    """Call `switch_off` after `error`, which the caller raises, and attach the outcome to `error`.

    `switch_off` returns True if it has confirmed the heater off.
    """
    try:
        if switch_off():
            carry(error, ShutdownOutcome())
    except Exception as failure:  # noqa: BLE001 (the caller raises `error`)
        carry(error, shutdown_of(failure) or ShutdownOutcome(failure))


def _for_others(error: BaseException) -> Exception:
    """Return the error for the other threads that wait for the end of this rig: not an interruption of this one."""
    if isinstance(error, Exception):
        return error
    ended = SafetyError("another thread was interrupted while it closed the rig", where="loop process")
    carry(ended, shutdown_of(error) or ShutdownOutcome(error))
    return ended


def _is_of_this_script(error: BusyError) -> bool:
    return error.holder_pid in {one.child.pid for one in _clients if not one.is_lost}


def _busy(where: str) -> BusyError:
    """Return the error for a line that this script uses already."""
    cure = "use the rig that is open, or close it first: call its close(), or open it in a `with` block"
    return BusyError("busy, because this script has a rig open on this line", where=where, cure=cure)
