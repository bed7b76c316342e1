"""The script's end of the link to its loop process: it starts the process, sends requests and waits for replies.

While a request is carried out, Ctrl-C (in a notebook: the interruption of the kernel) raises nothing in the script. The
interruption is sent to the loop process, which ends the run at zero current. When the process has confirmed this,
KeyboardInterrupt is raised. An exception of a signal handler ends the run in the same way before it is raised. A thread
receives the messages: a busy script does not delay them, and no interruption can cut a message.

One request is carried out at a time. A request that switches off is the exception: it ends the request of another
thread. This thread may hang in the display of its progress, so the thread that switches off sends the interruption.
"""

from __future__ import annotations

import pickle
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from multiprocessing import Pipe
from typing import Any

from smadrive.errors import ConfigError, LoopProcessError, StoppedError
from smadrive.interrupts import ABORTS_AT
from smadrive.posix import OwningProcess, check_posix
from smadrive.scripting.callbacks import check_may_wait
from smadrive.scripting.loop.interruptions import RequestSignals, ended_by_thread, error_to_raise, outlives_script
from smadrive.scripting.loop.loop_child import ENDS_WITHIN_S, LoopChild
from smadrive.scripting.loop.messages import (
    COMMAND,
    END,
    INTERRUPT,
    NUMBER_BYTES,
    REQUEST,
    CloseRequest,
    Failure,
    RemoteTracebackError,
    Result,
    RunProgress,
    SwitchOffRequest,
    send_whole,
)
from smadrive.scripting.loop.servo.messages import ServoCommand, ServoReport
from smadrive.scripting.loop.transfer import pickled

LOOK_S = 0.05
"""Interval in s at which a waiting script checks for an interruption."""

OBEYS_WITHIN_S = 10.0
"""After `ABORTS_AT` interruptions, the loop process is killed if it still runs after this time in s."""

Show = Callable[[RunProgress], None]
"""A function that shows the progress of a run."""


class LoopClient:
    """Starts a loop process. `call` sends a request to this process, and `end` ends it.

    Only the process that created this object may use it. In a forked child `call` and `command` raise ConfigError, and
    `end` and `kill` have no effect. `is_end_raised` is True after `call` has raised the error that the process died or
    was stopped. `on_report` is called in another thread with each report of a servo.
    """

    def __init__(self) -> None:
        check_posix()
        self._connection, theirs = Pipe()
        self.owner = OwningProcess()
        self._number = 0
        self._progress: RunProgress | None = None
        self._replies: dict[int, Result | Failure] = {}
        self._one_call, self._one_message, self._arrived = threading.Lock(), threading.RLock(), threading.Event()
        self._in_call = threading.local()  # a signal handler runs in the thread that it interrupts
        self._endable: RequestSignals | None = None
        self._ending = 0
        self._is_lost = self.is_end_raised = False
        self._stop: StoppedError | None = None
        self.on_report: Callable[[ServoReport], None] | None = None
        self._child = LoopChild(theirs.fileno())
        theirs.close()
        threading.Thread(target=self._listen, name="link to the loop", daemon=True).start()

    @property
    def pid(self) -> int:
        """The id of the loop process."""
        return self._child.pid

    @property
    def is_lost(self) -> bool:
        """True if the loop process has ended."""
        return self._is_lost

    @property
    def is_busy(self) -> bool:
        """True while a request is carried out. The wire may then be heated."""
        return self._one_call.locked()

    @property
    def ending(self) -> str:
        """Text that says that the loop process has ended, and what to do; empty while the process runs."""
        how = "loop process ended" if self._stop is None else self._stop
        return f"{how}, open the rig again" if self._is_lost else ""

    def call(self, request: Any, show: Show | None = None) -> Any:
        """Send a request. Return its result or raise its error. `show` is called with the progress of a run.

        A request that switches off first ends the request of another thread, which gets a SafetyError.

        KeyboardInterrupt after an interruption, and any exception of a signal handler of the script or of `show`, once
        the request has ended at zero current. StoppedError if `smadrive off` has stopped the process during this call
        or before it. LoopProcessError if the process has died. ControllerError if a controller cannot be pickled.
        MotionError in a callback of a servo (see callbacks.py). ConfigError in a signal handler during a call.
        """
        self.owner.check()
        check_may_wait("loop process")
        if getattr(self._in_call, "is_active", False):
            what, cure = "a signal handler must not use the rig during a request", "raise an exception in the handler"
            raise ConfigError(what, where="loop process", cure=cure)
        self._in_call.is_active = True  # before the lock: a handler that waited for it would wait for ever
        switches_off = isinstance(request, SwitchOffRequest | CloseRequest)
        try:
            with self._others_ended() if switches_off else nullcontext(), self._one_call:
                with RequestSignals() as signals:
                    reply = self._carried_out(pickled(request), signals, show, is_endable=not switches_off)
                error = error_to_raise(reply, signals)
        finally:
            self._in_call.is_active = False
        if error is not None:
            if isinstance(reply, Failure) and error is reply.error:
                self.is_end_raised = isinstance(error, StoppedError | LoopProcessError)
                raise error from (RemoteTracebackError(reply.traceback) if reply.traceback else None)
            raise error
        assert isinstance(reply, Result)
        return reply.value

    def command(self, servo_id: str, command: ServoCommand) -> None:
        """Send a command to the servo `servo_id`. A command that arrives before the ServoRequest waits for it."""
        self.owner.check()
        self._send(COMMAND + pickle.dumps((servo_id, command)))

    def end(self) -> None:
        """Ask the process to switch the heater off and to end. If it has not ended after `ENDS_WITHIN_S`, kill it."""
        if self.owner.is_present:
            self._send(END)
            self._child.wait()

    def kill(self) -> None:
        """Kill the process. The watchdog of the device or the guardian then switches the heater off."""
        if self.owner.is_present:
            self._child.kill()

    @contextmanager
    def _others_ended(self) -> Iterator[None]:
        """End the request of another thread now, and each further one, until the end of the `with` block."""
        with self._one_message:
            self._ending += 1
        try:
            self._end_request(ended_by_thread())
            yield
        finally:
            with self._one_message:
                self._ending -= 1

    def _end_request(self, error: BaseException) -> None:
        """Interrupt the present request, and let it fail with `error`; not a request that is over or switches off."""
        with self._one_message:
            if self._endable is not None and self._number not in self._replies:
                self._endable.keep(error)
                self._pass_on(self._endable)

    def _pass_on(self, signals: RequestSignals) -> None:
        with self._one_message:  # two threads pass on the same interruption only once
            while signals.passed_on < signals.interruptions:
                signals.passed_on += 1
                self._send(INTERRUPT + self._number.to_bytes(NUMBER_BYTES))

    def _carried_out(
        self, message: bytes, signals: RequestSignals, show: Show | None, *, is_endable: bool
    ) -> Result | Failure:
        """Send a pickled request and return its reply. An error in this method is kept in `signals`."""
        with self._one_message:
            self._number += 1
            self._replies.clear()
            self._endable = signals if is_endable else None
        self._progress, is_sent = None, False
        try:
            self._send(REQUEST + self._number.to_bytes(NUMBER_BYTES) + message)
            is_sent = True
            return self._reply(signals, show)
        except BaseException as error:  # noqa: BLE001 (raised by `call`, after the request has ended)
            signals.keep(error)
            if not is_sent:  # the request may not have arrived, and would then get no reply
                self._send(END)
            return self._reply(signals, None)

    def _reply(self, signals: RequestSignals, show: Show | None) -> Result | Failure:
        """Wait for the reply, which is the error of the process if it has ended. Pass interruptions on."""
        give_up_s = float("inf")
        while True:
            is_lost = self._is_lost  # read first: the last reply may have arrived just before the end
            if (reply := self._replies.get(self._number)) is not None:
                return reply
            if is_lost:
                return Failure(self._death(), "")
            if self._ending:
                self._end_request(ended_by_thread())
            elif not threading.main_thread().is_alive():
                self._end_request(outlives_script())
            self._pass_on(signals)
            if signals.passed_on >= ABORTS_AT:
                give_up_s = min(give_up_s, time.monotonic() + OBEYS_WITHIN_S)
            if signals.error is not None:
                give_up_s = min(give_up_s, time.monotonic() + ENDS_WITHIN_S)
            if time.monotonic() > give_up_s:
                self.kill()
            self._arrived.wait(LOOK_S)
            self._arrived.clear()
            if self._progress is not None and show is not None:
                show(self._progress)

    def _death(self) -> BaseException:
        """Return the error that tells why the process has ended."""
        error = self._child.error()
        return error if self._stop is None else self._stop

    def _send(self, message: bytes) -> None:
        """Send a message under a lock: a long message takes several writes, and no other thread may write between."""
        with self._one_message:
            send_whole(self._connection, message)

    def _listen(self) -> None:
        try:
            while True:
                number, message = pickle.loads(self._connection.recv_bytes())  # noqa: S301 (of the same user)
                if isinstance(message, RunProgress):
                    self._progress = message
                elif isinstance(message, ServoReport):
                    if self.on_report is not None:
                        self.on_report(message)
                else:
                    if isinstance(message, Failure) and isinstance(message.error, StoppedError):
                        self._stop = message.error
                    self._replies[number] = message
                    self._arrived.set()
        except (EOFError, OSError):
            pass
        finally:
            self._send(END)  # also after an error here: without reports, the loop must not go on
            self._is_lost = True
            self._arrived.set()
