"""The script's end of the link to its loop process: it starts the process, sends requests and waits for replies.

While a request is carried out, Ctrl-C (in a notebook: the interruption of the kernel) raises nothing in the script. The
interruption is sent to the loop process, which ends the run at zero current. When the process has confirmed this,
KeyboardInterrupt is raised. A thread receives the messages: a busy script does not delay them, and no interruption can
cut a message.
"""

from __future__ import annotations

import os
import pickle
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from multiprocessing import Pipe
from typing import Any
from weakref import WeakSet

from smadrive.errors import BusyError, LoopProcessError, StoppedError
from smadrive.interrupts import ABORTS_AT
from smadrive.numerics.blas_threads import ONE_THREAD
from smadrive.posix import OwningProcess, check_posix
from smadrive.safety.shutdown import shutdown_of
from smadrive.scripting.callbacks import check_may_wait
from smadrive.scripting.loop.interruptions import CountedInterrupts
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
    send_whole,
)
from smadrive.scripting.loop.servo_messages import ServoCommand, ServoReport
from smadrive.scripting.loop.transfer import pickled

MODULE = "smadrive.scripting.loop.loop_process"

LOOK_S = 0.05
"""Interval in s at which a waiting script checks for an interruption."""

ENDS_WITHIN_S = 30.0
"""The loop process is killed if it has not ended after this time in s. Two tries to switch off take some 20 s."""

OBEYS_WITHIN_S = 10.0
"""After `ABORTS_AT` interruptions, the loop process is killed if it still runs after this time in s."""

ENDED_BEFORE = "the request was done before the interruption, and no current flows"
"""The message of a KeyboardInterrupt that came too late to interrupt a request. Every request ends at zero current."""

_running: WeakSet[LoopClient] = WeakSet()

Show = Callable[[RunProgress], None]


def show_nothing(_progress: RunProgress) -> None:
    """Show no progress."""


class LoopClient:
    """Starts a loop process. `call` sends a request to this process, and `end` ends it.

    Only the process that created this object may use it. In a forked child `call` and `command` raise ConfigError, and
    `end` and `kill` have no effect.

    `is_end_raised` is True after `call` has raised the error that the process died or was stopped. `on_report` is
    called in another thread with each report of a servo.
    """

    def __init__(self) -> None:
        check_posix()
        self._connection, theirs = Pipe()
        self.owner = OwningProcess()
        self._number = 0
        self._progress: RunProgress | None = None
        self._replies: dict[int, Result | Failure] = {}
        self._arrived = threading.Event()
        self._one_call, self._one_message = threading.Lock(), threading.RLock()
        self._is_lost = False
        self._stop: StoppedError | None = None
        self.is_end_raised = False
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
        if not self._is_lost:
            return ""
        return f"{'loop process ended' if self._stop is None else self._stop}, open the rig again"

    def call(self, request: Any, show: Show = show_nothing) -> Any:
        """Send a request. Return its result or raise its error. `show` is called with the progress of a run.

        KeyboardInterrupt after an interruption, once the request has ended at zero current. StoppedError if
        `smadrive off` has stopped the process during this call or before it. LoopProcessError if the process has died.
        ControllerError if a controller cannot be pickled. MotionError in a callback of a servo (see callbacks.py).
        """
        self.owner.check()
        check_may_wait("loop process")
        with self._one_call, CountedInterrupts() as interrupts:
            message = pickled(request)
            self._number += 1
            self._progress = None
            self._send(REQUEST + self._number.to_bytes(NUMBER_BYTES) + message)
            reply = self._reply(interrupts, show)
        if interrupts.count and not isinstance(reply, Failure):
            raise KeyboardInterrupt(ENDED_BEFORE)
        if isinstance(reply, Failure):
            self.is_end_raised = isinstance(reply.error, StoppedError)
            raise _explained(reply.error) from (RemoteTracebackError(reply.traceback) if reply.traceback else None)
        return reply.value

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

    def _reply(self, interrupts: CountedInterrupts, show: Show) -> Result | Failure:
        passed_on, give_up_s = 0, float("inf")
        while True:
            is_lost = self._is_lost  # read first: the last reply may have arrived just before the end
            if (reply := self._replies.pop(self._number, None)) is not None:
                return reply
            if is_lost:
                raise self._death()
            while passed_on < interrupts.count:
                passed_on += 1
                self._send(INTERRUPT + self._number.to_bytes(NUMBER_BYTES))
            if passed_on >= ABORTS_AT:
                give_up_s = min(give_up_s, time.monotonic() + OBEYS_WITHIN_S)
            if time.monotonic() > give_up_s:
                self.kill()
            self._arrived.wait(LOOK_S)
            self._arrived.clear()
            if self._progress is not None:
                show(self._progress)

    def _death(self) -> BaseException:
        """Return the error that tells why the process has ended."""
        self.is_end_raised = True
        try:
            self._process.wait(ENDS_WITHIN_S)
        except subprocess.TimeoutExpired:
            self.kill()
        if self._stop is not None:
            return self._stop
        if self._process.returncode == 0:
            what, cure = "it has ended, because a signal or an error stopped it", "open the rig again"
            return LoopProcessError(what, where="loop process", cure=cure)
        return LoopProcessError(
            "it has died; the watchdog of the device, or the guardian, switches the heater off",
            where="loop process",
            value=_status(self._process.returncode),
            cure="confirm with `smadrive off RIG` that the heater is off, then open the rig again",
        )

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
    """Return the error to raise in the script.

    The message of a KeyboardInterrupt says that the heater is off, if this is confirmed. The message of a BusyError
    says if it is this script that uses the line.
    """
    outcome = shutdown_of(error)
    if isinstance(error, KeyboardInterrupt) and outcome is not None and outcome.confirmed:
        error.args = (str(outcome),)
    if isinstance(error, BusyError) and error.holder_pid in {client.pid for client in _running if not client.is_lost}:
        cure = "use the rig that is open, or close it first: call its close(), or open it in a `with` block"
        return BusyError("busy, because this script has a rig open on this line", where=error.where, cure=cure)
    return error


def _status(code: int) -> str:
    return f"signal {signal.Signals(-code).name}" if code < 0 else f"exit code {code}"
