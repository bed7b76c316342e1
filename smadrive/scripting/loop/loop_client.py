"""The script's end of the link to its loop process: it starts the process, sends requests and waits for replies.

While a request is carried out, Ctrl-C (in a notebook: the interruption of the kernel) raises nothing in the script. The
interruption is sent to the loop process, which ends the run at zero current. When the process has confirmed this,
KeyboardInterrupt is raised. An exception of a signal handler ends the run in the same way before it is raised. A thread
receives the messages: a busy script does not delay them, and no interruption can cut a message.
"""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from multiprocessing import Pipe
from typing import Any
from weakref import WeakSet

from smadrive.errors import BusyError, ConfigError, LoopProcessError, SafetyError, StoppedError
from smadrive.interrupts import ABORTS_AT
from smadrive.numerics.blas_threads import ONE_THREAD
from smadrive.posix import OwningProcess, check_posix
from smadrive.scripting.callbacks import check_may_wait
from smadrive.scripting.loop.interruptions import RequestSignals, error_to_raise
from smadrive.scripting.loop.messages import (
    COMMAND,
    END,
    INTERRUPT,
    NUMBER_BYTES,
    REQUEST,
    Failure,
    RemoteTracebackError,
    Result,
    RunProgress,
    Show,
    process_error,
    send_whole,
    show_nothing,
)
from smadrive.scripting.loop.servo.servo_messages import ServoCommand, ServoReport
from smadrive.scripting.loop.transfer import pickled

MODULE = "smadrive.scripting.loop.loop_process"

LOOK_S = 0.05
"""Interval in s at which a waiting script checks for an interruption."""

ENDS_WITHIN_S = 30.0
"""The loop process is killed if it has not ended after this time in s. Two tries to switch off take some 20 s."""

OBEYS_WITHIN_S = 10.0
"""After `ABORTS_AT` interruptions, the loop process is killed if it still runs after this time in s."""

_running: WeakSet[LoopClient] = WeakSet()


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
        self._signals = RequestSignals()
        self._is_lost = self.is_end_raised = False
        self._stop: StoppedError | None = None
        self.on_report: Callable[[ServoReport], None] | None = None
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-m", MODULE, str(theirs.fileno())],
            stdin=subprocess.DEVNULL,
            pass_fds=[theirs.fileno()],
            env={**os.environ, **ONE_THREAD},
            start_new_session=True,  # Ctrl-C is for the script, which passes it on
        )
        theirs.close()
        _running.add(self)
        threading.Thread(target=self._listen, name="link to the loop", daemon=True).start()

    @property
    def pid(self) -> int:
        """The id of the loop process."""
        return self._process.pid

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

    def call(self, request: Any, show: Show = show_nothing) -> Any:
        """Send a request. Return its result or raise its error. `show` is called with the progress of a run.

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
        try:
            with self._one_call, RequestSignals() as signals:
                self._signals = signals
                reply = self._carried_out(pickled(request), signals, show)
        finally:
            self._in_call.is_active = False
        if (error := error_to_raise(reply, signals)) is not None:
            if isinstance(reply, Failure) and error is reply.error:
                self.is_end_raised = isinstance(error, StoppedError | LoopProcessError)
                raise _explained(error) from (RemoteTracebackError(reply.traceback) if reply.traceback else None)
            raise error
        assert isinstance(reply, Result)
        return reply.value

    def stop_request(self) -> None:
        """End the request of another thread at zero current, and wait for its end. That thread gets a SafetyError."""
        if not getattr(self._in_call, "is_active", False):
            while not self._one_call.acquire(timeout=LOOK_S):
                self._signals.keep(SafetyError("another thread has called off() or close()", where="loop process"))
            self._one_call.release()

    def command(self, servo_id: str, command: ServoCommand) -> None:
        """Send a command to the servo `servo_id`. A command that arrives before the ServoRequest waits for it."""
        self.owner.check()
        self._send(COMMAND + pickle.dumps((servo_id, command)))

    def end(self) -> None:
        """Ask the process to switch the heater off and to end. If it has not ended after `ENDS_WITHIN_S`, kill it."""
        if not self.owner.is_present:
            return
        self._send(END)
        try:
            self._process.wait(ENDS_WITHIN_S)
        except subprocess.TimeoutExpired:
            self.kill()

    def kill(self) -> None:
        """Kill the process. The watchdog of the device or the guardian then switches the heater off."""
        if self.owner.is_present:
            self._process.kill()
            self._process.wait()

    def _carried_out(self, message: bytes, signals: RequestSignals, show: Show) -> Result | Failure:
        """Send a pickled request and return its reply. An error in this method is kept in `signals`."""
        self._number += 1
        self._progress, is_sent = None, False
        self._replies.clear()
        try:
            self._send(REQUEST + self._number.to_bytes(NUMBER_BYTES) + message)
            is_sent = True
            return self._reply(signals, show)
        except BaseException as error:  # noqa: BLE001 (raised by `call`, after the request has ended)
            signals.keep(error)
            if not is_sent:  # the request may not have arrived, and would then get no reply
                self._send(END)
            return self._reply(signals, show_nothing)

    def _reply(self, signals: RequestSignals, show: Show) -> Result | Failure:
        """Wait for the reply, which is the error of the process if it has ended. Pass interruptions on."""
        give_up_s = float("inf")
        while True:
            is_lost = self._is_lost  # read first: the last reply may have arrived just before the end
            if (reply := self._replies.get(self._number)) is not None:
                return reply
            if is_lost:
                return Failure(self._death(), "")
            signals.look_at_main_thread()
            while signals.passed_on < signals.interruptions:
                signals.passed_on += 1
                self._send(INTERRUPT + self._number.to_bytes(NUMBER_BYTES))
            if signals.passed_on >= ABORTS_AT:
                give_up_s = min(give_up_s, time.monotonic() + OBEYS_WITHIN_S)
            if signals.error is not None:
                give_up_s = min(give_up_s, time.monotonic() + ENDS_WITHIN_S)
            if time.monotonic() > give_up_s:
                self.kill()
            self._arrived.wait(LOOK_S)
            self._arrived.clear()
            if self._progress is not None:
                show(self._progress)

    def _death(self) -> BaseException:
        """Return the error that tells why the process has ended."""
        try:
            self._process.wait(ENDS_WITHIN_S)
        except subprocess.TimeoutExpired:
            self.kill()
        if self._stop is not None:
            return self._stop
        return process_error(self._process.returncode)

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


def _explained(error: BaseException) -> BaseException:
    """Return the error to raise in the script. A BusyError says if it is this script that uses the line."""
    if isinstance(error, BusyError) and error.holder_pid in {client.pid for client in _running if not client.is_lost}:
        cure = "use the rig that is open, or close it first: call its close(), or open it in a `with` block"
        return BusyError("busy, because this script has a rig open on this line", where=error.where, cure=cure)
    return error
