"""The guardian, a process that outlives the driver and switches the heat source off when the driver cannot.

A bench supply without a watchdog keeps heating when its driver is killed, stands still or crashes. So the driver starts
this process. At every use of a port, the driver writes a byte to the guardian through a pipe:

    w   watch: heating begins        b   heartbeat: the driver lives       r   stand down: no guardian is needed now
    g   give way: the driver has learnt of the take-over and has closed its connections
    h   hand over: the driver could not switch off, and has closed its connections

The guardian answers `w` and `b` with `e` (echo), so that the driver knows that the guardian lives. A silence of
`timeout_s`, or the end of the pipe, means that the driver stands still or is dead. states.py has the states of the
guardian and what it does in each of them.

Two clients on one line would take each other's replies for their own. So the guardian writes `t` (taken over) to the
driver through another pipe. A driver that only stood still reads `t` when it wakes, before it uses a port. Then it
closes its connections, sends `g`, then `r`, and waits. When the guardian has confirmed the safe state once more, it
answers `r` with `f` (free): the driver may use the ports, and the guardian is ready to watch again.

The guardian answers `h` with `t`, switches off, and then sends `f`. It may find the device at a port that the driver
does not know. Before every attempt and every use of a port, it sends `e`. A driver that waits for its ports kills a
guardian that is silent.

    python -m smadrive.devices.guardian.process

The first line of standard input is the task, a JSON object.
"""

from __future__ import annotations

import contextlib
import os
import select
import signal
import threading
import time

from smadrive.devices.guardian.duty import HeldDuty
from smadrive.devices.guardian.search import PortSearch
from smadrive.devices.guardian.states import Action, AttemptOutcome, DriverSignal, GuardianState, run
from smadrive.devices.guardian.switch import AttemptResult, LineAccess, OffSwitch
from smadrive.devices.guardian.task import (
    ECHO,
    FREE,
    GIVES_WAY,
    HAND_OVER,
    HEARTBEAT,
    READY,
    STAND_DOWN,
    TAKEN,
    WATCH,
    Task,
)
from smadrive.devices.profile.profile import load_profile
from smadrive.devices.state.key import key_at
from smadrive.devices.state.lock import Role
from smadrive.real_time import GUARDIAN_PRIORITY, use_real_time_scheduling

DRIVER_FD, TERMINAL_FD = 1, 2
SIGNALS = {
    WATCH: DriverSignal.HEARTBEAT,
    HEARTBEAT: DriverSignal.HEARTBEAT,
    STAND_DOWN: DriverSignal.STAND_DOWN,
    GIVES_WAY: DriverSignal.GIVES_WAY,
    HAND_OVER: DriverSignal.HAND_OVER,
}
ANSWERS = {Action.ECHO: ECHO, Action.FREE: FREE, Action.TAKE: TAKEN}

TERMINAL_WITHIN_S = 0.2
REMIND_S = 600.0
"""A guardian that waits for its device repeats its message after this time in seconds."""


class DriverProcess:
    """The driver, which is the parent process: the signals that it sends through a pipe, and its end.

    Create this object before READY is sent: the driver waits for READY, so until then the parent is certainly the
    driver.
    """

    def __init__(self, descriptor: int) -> None:
        self._descriptor = descriptor
        self.pid = os.getppid()
        self.ended = False

    def read_line(self) -> bytes:
        """Return the first line of the pipe. It is read byte by byte, because the bytes behind the line are signals."""
        line = b""
        while not line.endswith(b"\n") and (byte := os.read(self._descriptor, 1)):
            line += byte
        return line

    def listen(self, within_s: float) -> DriverSignal:
        """Wait up to `within_s` for signals of the driver, and return the last one; SILENCE if none arrive.

        At the end of the pipe return CLOSED; in every later call wait `within_s` and return SILENCE.
        """
        if self.ended:
            time.sleep(within_s)
            return DriverSignal.SILENCE
        ready, _, _ = select.select((self._descriptor,), (), (), within_s)
        if not ready:
            return DriverSignal.SILENCE
        data = os.read(self._descriptor, 4096)
        self.ended = not data
        return SIGNALS.get(data[-1:], DriverSignal.HEARTBEAT) if data else DriverSignal.CLOSED

    def end(self) -> None:
        """Kill the driver with SIGKILL if it is still the parent process.

        After the end of the driver, its process id may belong to another program.
        """
        if os.getppid() == self.pid:
            _print(f"the driver gives no sign of life and may hold the only connection: ending it (process {self.pid})")
            with contextlib.suppress(OSError):
                os.kill(self.pid, signal.SIGKILL)


class Guardian:
    """Carries out what the table in states.py demands: attempts to switch off, answers to the driver, messages."""

    def __init__(
        self, driver: DriverProcess, switch: OffSwitch, access: LineAccess, duty: HeldDuty, timeout_s: float
    ) -> None:
        self._driver = driver
        self._switch = switch
        self._access = access
        self._duty = duty
        self._timeout_s = timeout_s
        self._last: tuple[AttemptOutcome, bool] | None = None
        self._printed_s = 0.0

    def attempt(self, state: GuardianState) -> AttemptOutcome:
        """Try to switch the device off. Print the outcome if it has changed, and return it; see `run`."""
        waits = state is GuardianState.WAITING_FOR_DEVICE
        if waits and self._duty.relieved:
            _print("another driver, or `smadrive off`, has confirmed that the heater is off: this guardian ends")
            return AttemptOutcome.RELIEVED
        result = self._switch.off(alone=waits)
        if waits:
            self._access.release_shared()
        if waits and result.outcome is not AttemptOutcome.CONFIRMED:
            self._duty.wait(result.text)
        self._report(result, state)
        return result.outcome

    def act(self, action: Action) -> None:
        """Carry out an action of the table: answer the driver, or kill it; see `run`."""
        if action is Action.END_DRIVER:
            self._driver.end()
            return
        if action is Action.TAKE:
            self._access.hold_as(Role.GUARDIAN, os.getpid())
        if action is Action.FREE:
            self._access.hold_as(Role.DRIVER, self._driver.pid)
            self._last = None
        _answer(ANSWERS[action])

    def _report(self, result: AttemptResult, state: GuardianState) -> None:
        """Print the result of an attempt to switch off, unless the last attempt had the same outcome.

        Before the first result, print why the guardian takes over. When the guardian begins to wait for its device, and
        then every `REMIND_S`, the same outcome is printed again.
        """
        waits = state is GuardianState.WAITING_FOR_DEVICE
        if self._last is None:
            _print(f"the driver {self._reason(state)}: taking over")
        reminds = waits and time.monotonic() - self._printed_s > REMIND_S
        if (result.outcome, waits) != self._last or reminds:
            _print(_message(result, waits=waits))
            self._printed_s = time.monotonic()
        self._last = result.outcome, waits

    def _reason(self, state: GuardianState) -> str:
        """Return why the guardian takes over; `state` is the state of its first attempt."""
        if state is GuardianState.WAITING_FOR_DEVICE:
            return "ended while heating"
        if state is GuardianState.RELEASING:
            return "could not switch the heater off"
        return f"stood still for {self._timeout_s:g} s while heating"


def _message(result: AttemptResult, *, waits: bool) -> str:
    if result.outcome is AttemptOutcome.CONFIRMED:
        return result.text
    if result.outcome is AttemptOutcome.GONE:
        return f"the heater was NOT confirmed off ({result.text}): this guardian ends"
    message = f"the heater is NOT confirmed off yet ({result.text}): cut its supply"
    if not waits:
        return message
    return f"{message}, or connect the device again. This guardian waits for it; to end the wait: kill -9 {os.getpid()}"


def _show_life() -> None:
    _answer(ECHO)


def _answer(what: bytes) -> None:
    with contextlib.suppress(OSError):  # the driver has ended, or does not read the pipe
        os.write(DRIVER_FD, what)


def _print(text: str) -> None:
    """Print to the terminal, which may be gone or stalled: wait at most `TERMINAL_WITHIN_S`.

    Print nothing if the system has no thread or no memory left.
    """
    line = f"smadrive guardian: {text}\n".encode()

    def write() -> None:
        with contextlib.suppress(OSError):
            os.write(TERMINAL_FD, line)

    with contextlib.suppress(RuntimeError, MemoryError):
        writer = threading.Thread(target=write, daemon=True)
        writer.start()
        writer.join(TERMINAL_WITHIN_S)


def guard(task: Task, driver: DriverProcess) -> None:
    """Lock the duty file, send READY to the driver, and run the table of states until DONE.

    If another guardian keeps the duty file, print that and return without READY.
    """
    device, profile = task.device, load_profile(task.device.profile)
    key = key_at(device.url, profile, device.unit_id).with_identity(profile, device.identity)
    duty = HeldDuty.take(f"{device.profile} at {device.url}", key)
    if duty is None:
        _print(f"another guardian of {device.profile} at {device.url} does not end: end that process first")
        return
    with duty:
        access = LineAccess(task.locks)
        switch = OffSwitch(device, profile, PortSearch(device.url, key.names, time.monotonic), access, _show_life)
        guardian = Guardian(driver, switch, access, duty, task.timeout_s)
        use_real_time_scheduling(GUARDIAN_PRIORITY)
        _answer(READY)
        run(driver.listen, guardian.attempt, guardian.act, task.timeout_s)


def main() -> None:
    """Read the task from the driver, then guard the device until the guardian is not needed any more."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGPIPE):
        signal.signal(number, signal.SIG_IGN)  # the guardian ends by itself after the driver
    os.set_blocking(DRIVER_FD, False)
    driver = DriverProcess(0)
    if line := driver.read_line():  # the line is empty if the driver ended before it sent a task
        guard(Task.from_json(line), driver)


if __name__ == "__main__":
    main()
