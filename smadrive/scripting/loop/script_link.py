"""The loop process's end of the link: it receives requests and interruptions, and sends replies and progress.

A thread receives the messages. It turns an interruption, and every end of the script, into a signal for the main
thread. The signal ends a run at the next tick, never in the middle of an exchange with a device. As after Ctrl-C, the
run ends at zero current, confirmed by read-back. In code that uses no device and may take long, such as a controller of
the user, the signal acts at once. interruptions.py has the rules as a table.
"""

from __future__ import annotations

import os
import pickle
import queue
import select
import signal
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext, suppress
from math import inf
from multiprocessing.connection import Connection
from types import FrameType
from typing import Any

from smadrive.control.loop import Tick, TickHandler, never
from smadrive.interrupts import unblock_signals
from smadrive.runs.run_log import TickRecorder
from smadrive.scripting.loop.code_origin import dumps
from smadrive.scripting.loop.failures import dumped_failure, stopped_script
from smadrive.scripting.loop.interruptions import AT_ONCE, INTERRUPTIBLE, Phase
from smadrive.scripting.loop.messages import (
    COMMAND,
    END,
    INTERRUPT,
    NUMBER_BYTES,
    Result,
    RunProgress,
    ScriptEndedError,
)
from smadrive.scripting.loop.script_process import ScriptProcess
from smadrive.scripting.loop.servo.messages import ServoCommand, ServoReport

LOOK_S = 0.5
"""Interval in s of the check that the script still runs, because a child of the script may keep the socket open."""

PROGRESS_S = 0.1


class ScriptLink:
    """The link to the script, which is the parent process, on the socket `descriptor`. Create it in the main thread."""

    def __init__(self, descriptor: int) -> None:
        self._connection: Connection[Any, Any] = Connection(descriptor)
        self._script = ScriptProcess(os.getppid())
        self._requests: queue.SimpleQueue[bytes] = queue.SimpleQueue()
        self._commands: queue.SimpleQueue[bytes] = queue.SimpleQueue()
        self._number, self._interrupted_number, self._stopped_number = 0, -1, -1
        self._phase = Phase.WAITING
        self._is_ending = False
        self.stop_requested = never
        """Called at an interruption. True means that `smadrive off` sent the interruption; the rig is then closed."""
        self._pending: type[BaseException] | None = None
        self._loop_thread = threading.main_thread().ident or 0
        signal.signal(signal.SIGINT, self._interrupt)
        for ending in (signal.SIGTERM, signal.SIGHUP):
            signal.signal(ending, self._end)
        unblock_signals()
        threading.Thread(target=self._listen, name="link to the script", daemon=True).start()

    def opening(self) -> Any:
        """Wait for the first request and return it. No interruption acts until the rig is open.

        Raises ScriptEndedError if the script has ended, and any error of unpickling.
        """
        return pickle.loads(self._next_request())  # noqa: S301 (of the same user)

    def request(self) -> Any:
        """Wait for the next request and return it. An interruption acts from its arrival until `interruptible` ends.

        Raises ScriptEndedError if the script has ended, KeyboardInterrupt, and any error of unpickling.
        """
        data = self._next_request()
        self._pending = None
        with self._in(Phase.RESTORING, Phase.WAITING):
            return pickle.loads(data)  # noqa: S301 (of the same user)

    def _next_request(self) -> bytes:
        """Wait for the next request, keep its number, and return its pickled content."""
        self._phase = Phase.WAITING  # a signal may have cut the end of the phase before
        if self._is_ending:
            raise ScriptEndedError
        message = self._requests.get()
        if message == END:
            raise ScriptEndedError
        self._number = int.from_bytes(message[1 : 1 + NUMBER_BYTES])
        return message[1 + NUMBER_BYTES :]

    @contextmanager
    def interruptible(self) -> Iterator[None]:
        """In the `with` block, an interruption or the end of the script is raised by the next `check` or `at_once`.

        If one has arrived since the request was taken, the block does not begin.
        """
        with self._in(Phase.CARRYING_OUT, Phase.WAITING):
            if self._interrupted_number == self._number:
                self._pending = self._pending or KeyboardInterrupt
            self.check()
            yield

    @contextmanager
    def at_once(self) -> Iterator[None]:
        """Let a signal end the `with` block at any place. Use it for code that may take long and uses no device."""
        with self._in(Phase.OWN_CODE, Phase.CARRYING_OUT):
            self.check()
            yield

    @contextmanager
    def _in(self, phase: Phase, following: Phase) -> Iterator[None]:
        self._phase = phase
        try:
            yield
        finally:
            self._phase = following

    def check(self) -> None:
        """Raise the pending KeyboardInterrupt or ScriptEndedError, even if the user's code has caught it before."""
        if self._pending is not None:
            raise self._pending

    @contextmanager
    def watch(self, recorder: TickRecorder, duration_s: float) -> Iterator[TickHandler]:
        """Yield the function that records each tick, calls `check`, and sends the progress every `PROGRESS_S`."""
        sent_s = -inf

        def record(tick: Tick) -> None:
            nonlocal sent_s
            recorder.tick(tick)
            self.check()
            if time.monotonic() - sent_s >= PROGRESS_S:
                sent_s = time.monotonic()
                self._report(RunProgress(tick, duration_s))

        yield record

    def next_command(self, servo_id: str, *, waits: bool) -> ServoCommand | None:
        """Return the next command for the servo `servo_id`. If there is none, wait for it (`waits`) or return None.

        Commands for an earlier servo are dropped. A signal ends the waiting.
        """
        while True:
            try:
                with self.at_once() if waits else nullcontext():
                    message = self._commands.get(block=waits)
            except queue.Empty:
                return None
            addressee, command = pickle.loads(message)  # noqa: S301 (of the same user)
            if addressee == servo_id:
                found: ServoCommand = command
                return found

    def report(self, report: ServoReport, *, waits: bool) -> bool:
        """Send a report of the servo, and return True. If the script does not read, wait (`waits`) or return False."""
        if not waits and not self._is_writable():
            return False
        self._send(pickle.dumps((self._number, report)))
        return True

    def finish(self) -> None:
        """Ignore signals from now on: the rig is closed, and only the last reply must still be sent."""
        self._is_ending = True

    def reply(self, value: Any) -> None:
        """Send the result of the request."""
        self._send(dumps((self._number, Result(value))))

    def fail(self, error: BaseException, *, is_own_code: bool) -> None:
        """Send the error that ended the request, with its traceback if code of the user may have raised it."""
        if self._stopped_number == self._number and isinstance(error, KeyboardInterrupt):
            error = stopped_script(error)
        self._send(dumped_failure(self._number, error, is_own_code=is_own_code))

    def _report(self, progress: RunProgress) -> None:
        """Send the progress, unless the script does not read: the loop never waits for the script."""
        if self._is_writable():
            self._send(pickle.dumps((self._number, progress)))

    def _is_writable(self) -> bool:
        poll = select.poll()  # select() cannot handle a descriptor above 1023
        poll.register(self._connection, select.POLLOUT)
        return bool(poll.poll(0))

    def _send(self, message: bytes) -> None:
        with suppress(OSError):  # the script has gone: the listening thread ends this process
            self._connection.send_bytes(message)

    def _listen(self) -> None:
        while (message := self._received()) != END:
            if message:
                self._script.has_run()
            if message.startswith(INTERRUPT):
                self._interrupt_request(int.from_bytes(message[1:]))
            elif message.startswith(COMMAND):
                self._commands.put(message[1:])
            elif message:
                self._requests.put(message)
            elif self._script.is_stopped(time.monotonic()) and self._stopped_number != self._number:
                self._stopped_number = self._number  # once: HeldSignals would count the others
                self._interrupt_request(self._number)
        signal.pthread_kill(self._loop_thread, signal.SIGTERM)
        self._requests.put(END)  # the signal has no effect while the heater is being switched off after a trip

    def _interrupt_request(self, number: int) -> None:
        """Interrupt the request `number`, now or as soon as it begins."""
        self._interrupted_number = max(self._interrupted_number, number)
        if number == self._number:
            signal.pthread_kill(self._loop_thread, signal.SIGINT)

    def _received(self) -> bytes:
        """Return the next message; END if the script has ended, b"" if no message arrived within `LOOK_S`."""
        try:
            if self._connection.poll(LOOK_S):
                return self._connection.recv_bytes()
        except (EOFError, OSError):
            return END
        return END if self._script.has_ended() else b""

    def _interrupt(self, _number: int, _frame: FrameType | None) -> None:
        if (self._phase in INTERRUPTIBLE or self.stop_requested()) and not self._is_ending:
            self._act(KeyboardInterrupt)

    def _end(self, _number: int, _frame: FrameType | None) -> None:
        if not self._is_ending:
            self._is_ending = True
            self._act(ScriptEndedError)

    def _act(self, kind: type[BaseException]) -> None:
        """Raise `kind` now if a signal may act at once, otherwise at the next `check`."""
        self._pending = kind
        if self._phase in AT_ONCE:
            raise kind
