"""The script's end of the link to its loop process: it starts the process, sends requests and waits for replies.

While a request is carried out, Ctrl-C (in a notebook: the interruption of the kernel) raises nothing in the script. The
interruption is sent to the loop process, which ends the run at zero current. When the process has confirmed this,
KeyboardInterrupt is raised. An exception of a signal handler ends the run in the same way before it is raised. A thread
receives the messages: a busy script does not delay them, and no interruption can cut a message.

turns.py tells what happens when several threads of the script use the rig, and main_thread.py, why a long request ends
with the main thread.
"""

from __future__ import annotations

import pickle
import threading
import time
from collections.abc import Callable
from multiprocessing import Pipe
from typing import Any

from smadrive.errors import ControllerError, StoppedError
from smadrive.interrupts import ABORTS_AT
from smadrive.posix import OwningProcess, check_posix
from smadrive.scripting.loop.client.loop_child import ENDS_WITHIN_S, LoopChild
from smadrive.scripting.loop.client.main_thread import main_thread_has_ended, outlives_script
from smadrive.scripting.loop.client.turns import Turns, ended_by_thread
from smadrive.scripting.loop.interruptions import RequestSignals, error_to_raise
from smadrive.scripting.loop.messages import (
    COMMAND,
    END,
    INTERRUPT,
    NUMBER_BYTES,
    REQUEST,
    Failure,
    LongRequest,
    RemoteTracebackError,
    Result,
    RunProgress,
    ServoRequest,
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
    `end` and `kill` have no effect. `child` is the loop process. `turns` ends the requests of other threads.
    `on_report` is called in another thread with each report of a servo.
    """

    def __init__(self) -> None:
        check_posix()
        self._connection, theirs = Pipe()
        self.owner = OwningProcess()
        self._number = 0
        self._progress: RunProgress | None = None
        self._replies: dict[int, Result | Failure] = {}
        self._one_message, self._arrived = threading.RLock(), threading.Event()
        self.turns = Turns(self._end_run)
        self._request: Any = None
        self._signals = RequestSignals()
        self._is_lost = False
        self.on_report: Callable[[ServoReport], None] | None = None
        self.child = LoopChild(theirs.fileno())
        theirs.close()
        threading.Thread(target=self._listen, name="link to the loop", daemon=True).start()

    @property
    def is_lost(self) -> bool:
        """True if the loop process has ended."""
        return self._is_lost

    @property
    def is_busy(self) -> bool:
        """True while a request is carried out. The wire may then be heated."""
        return self.turns.is_taken

    @property
    def ending(self) -> str:
        """Text that says that the loop process has ended, and what to do; empty while the process runs."""
        return f"{self.child.stop or 'loop process ended'}, open the rig again" if self._is_lost else ""

    def call(self, request: Any, show: Show | None = None) -> Any:
        """Send a request. Return its result or raise its error. `show` is called with the progress of a run.

        KeyboardInterrupt after an interruption, and any exception of a signal handler of the script or of `show`, once
        the request has ended at zero current. StoppedError if `smadrive off` has stopped the process during this call
        or before it. LoopProcessError if the process has died. ControllerError if a controller cannot be pickled.
        MotionError in a callback of a servo (see callbacks.py). ConfigError in a signal handler during a call.
        """
        self.owner.check()
        with self.turns.turn(request):
            with RequestSignals() as signals:
                reply = self._carried_out(request, signals, show)
            error = error_to_raise(reply, signals)
        if error is not None:
            self.child.note_raised(error)
            if isinstance(reply, Failure) and error is reply.error:
                raise error from (RemoteTracebackError(reply.traceback) if reply.traceback else error.__cause__)
            raise error
        assert isinstance(reply, Result)
        return reply.value

    def carries_out(self, request: Any) -> bool:
        """Return True while `request` is carried out."""
        return self.is_busy and self._request is request

    def check_may_call(self) -> None:
        """Raise the error of `call` if this thread must not wait for a request now."""
        self.owner.check()
        self.turns.check_may_wait()

    def command(self, servo_id: str, command: ServoCommand) -> None:
        """Send a command to the servo `servo_id`. A command that arrives before the ServoRequest waits for it."""
        self.owner.check()
        self._send(COMMAND + pickle.dumps((servo_id, command)))

    def end(self) -> None:
        """Ask the process to switch the heater off and to end. If it has not ended after `ENDS_WITHIN_S`, kill it."""
        if self.owner.is_present:
            self._send(END)
            self.child.wait()

    def kill(self) -> None:
        """Kill the process. The watchdog of the device or the guardian then switches the heater off."""
        if self.owner.is_present:
            self.child.kill()

    def _end_run(self, error: BaseException) -> None:
        """Interrupt the present request if it is long, not over, and not that of a servo; let it fail with `error`."""
        if not isinstance(self._request, ServoRequest):
            self._end_request(error)

    def _end_request(self, error: BaseException) -> None:
        """Interrupt the present request if it is long and not over, and let it fail with `error`."""
        with self._one_message:
            is_long = isinstance(self._request, LongRequest) and self._number not in self._replies
            signals = self._signals if is_long else None
            if signals is not None:
                signals.keep(error)
        if signals is not None:
            self._pass_on(signals)

    def _pass_on(self, signals: RequestSignals) -> None:
        """Send the interruptions that were not sent yet. Two threads send the same one only once."""
        if signals.passed_on < signals.interruptions:
            with self._one_message:
                count = signals.interruptions - signals.passed_on
                signals.passed_on += count
            for _ in range(count):
                self._send(INTERRUPT + signals.number.to_bytes(NUMBER_BYTES))

    def _carried_out(self, request: Any, signals: RequestSignals, show: Show | None) -> Result | Failure:
        """Send a request and return its reply. An error of the sending or of `show` is kept in `signals`."""
        try:
            message = pickled(request)
        except ControllerError as error:
            return Failure(error, "")
        with self._one_message:
            self._number += 1
            self._replies.clear()
            self._request, self._signals, signals.number = request, signals, self._number
        if self.turns.is_ended:  # by a thread that found no request to end
            self._end_run(ended_by_thread())
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
                return Failure(self.child.error(), "")
            self._look_at_main_thread()
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

    def _look_at_main_thread(self) -> None:
        if main_thread_has_ended():
            self._end_request(outlives_script())

    def _send(self, message: bytes) -> None:
        """Send a message under a lock: a long message takes several writes, and no other thread may write between."""
        send_whole(self._connection, message, self._one_message)

    def _listen(self) -> None:
        try:
            while True:
                number, message = pickle.loads(self._connection.recv_bytes())  # noqa: S301 (of the same user)
                if isinstance(message, RunProgress):
                    self._progress = message
                    self._look_at_main_thread()  # the thread of the request may hang in its display
                elif isinstance(message, ServoReport):
                    if self.on_report is not None:
                        self.on_report(message)
                else:
                    if isinstance(message, Failure) and isinstance(message.error, StoppedError):
                        self.child.stop = message.error
                    self._replies[number] = message
                    self._arrived.set()
        except (EOFError, OSError):
            pass
        finally:
            self._send(END)  # also after an error here: without reports, the loop must not go on
            self._is_lost = True
            self._arrived.set()
