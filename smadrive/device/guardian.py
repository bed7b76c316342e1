"""The guardian: a process that outlives the driver and switches the heat source off when the driver no longer can.

A bench supply without a watchdog heats on when its driver is killed, stands still or crashes. So the driver starts this
process beside itself and writes it a byte at every use of a port, through a pipe:

    w   watch: heating begins        b   a beat: the driver lives        r   rest: the driver needs no guardian now

Every byte is echoed, so that the driver knows that the guardian lives too. While it watches, no byte for `timeout_s`,
or the end of the pipe, means that the driver is gone: the guardian opens the ports itself (it needs no lock for that)
and writes the safe state until every device has confirmed it. Two masters on one line would take each other's replies
for their own: a driver that only stood still finds `t` (taken over) in the other pipe when it wakes, before it uses a
port. It lets its connections go, says `r` and waits; the guardian looks once more, in case one last command slipped
through. Every `r` is answered by `f` (free): the ports are the driver's, and the guardian is ready to watch again. From
its start it needs no file and no terminal.

    python -m smadrive.device.guardian        its task, a JSON object, is the first line of standard input
"""

from __future__ import annotations

import contextlib
import json
import os
import select
import signal
import threading
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field

from smadrive.device.anydevice import device_on
from smadrive.device.identity import Identity
from smadrive.device.profile import Profile, load_profile
from smadrive.modbus.connect import open_transport

WATCH, BEAT, REST = b"w", b"b", b"r"
READY, ECHO, TAKEN, FREE = b"y", b"e", b"t", b"f"
DRIVER_FD, TERMINAL_FD = 1, 2

LOOK_AGAIN_S = 0.5
TERMINAL_WITHIN_S = 0.2
GIVE_UP_S = 3600.0
"""A device that cannot be reached for an hour has been taken away."""


@dataclass(frozen=True)
class GuardedDevice:
    """A device to bring to its safe state, as the rig file names it."""

    profile: str
    url: str
    unit_id: int | None
    identity: Identity = field(default_factory=dict)
    """What the driver found it to be: no other confirms anything."""


@dataclass(frozen=True)
class Task:
    """What the guardian is told at its start."""

    devices: tuple[GuardedDevice, ...]
    timeout_s: float

    def to_json(self) -> bytes:
        """One line."""
        return json.dumps(asdict(self)).encode() + b"\n"

    @classmethod
    def from_json(cls, line: bytes) -> Task:
        """What `to_json` wrote."""
        task = json.loads(line)
        return cls(tuple(GuardedDevice(**device) for device in task["devices"]), task["timeout_s"])


class Pipe:
    """What the driver says, without waiting longer than told."""

    def __init__(self, descriptor: int) -> None:
        self._descriptor = descriptor
        self.ended = False

    def read_line(self) -> bytes:
        """The first line, byte by byte: what follows it belongs to the watch."""
        line = b""
        while not line.endswith(b"\n") and (byte := os.read(self._descriptor, 1)):
            line += byte
        return line

    def said(self, within_s: float) -> bytes:
        """The last thing said, waiting at most `within_s` for it; empty when nothing was."""
        if self.ended:
            time.sleep(within_s)
            return b""
        ready, _, _ = select.select((self._descriptor,), (), (), within_s)
        if not ready:
            return b""
        data = os.read(self._descriptor, 4096)
        self.ended = not data
        return data[-1:]


def guard(task: Task, profiles: Sequence[Profile], driver: Pipe) -> None:
    """Watch until the driver ends; take over whenever it fails while heating."""
    watching = False
    while not driver.ended:
        said = driver.said(task.timeout_s)
        if watching and not said:
            reason = "ended" if driver.ended else f"stood still for {task.timeout_s:g} s"
            _take_over(task, profiles, driver, reason)
            watching = False
        elif said:
            _tell(FREE if said == REST else ECHO)
            watching = said in (WATCH, BEAT)


def _take_over(task: Task, profiles: Sequence[Profile], driver: Pipe, reason: str) -> None:
    """Safe state, confirmed; then again and again while a driver that stood still may still wake and command."""
    _tell(TAKEN)
    give_up_s = time.monotonic() + GIVE_UP_S
    told = ""
    rests = False
    while time.monotonic() < give_up_s:
        problem = _switch_off(task, profiles)
        if not told:
            _say(f"the driver {reason} while heating: taking over")
        news = problem or "heater off, confirmed by read-back"
        if news != told:
            _say(news)
            told = news
        if problem is None and (rests or driver.ended):
            _tell(FREE)
            return
        rests = driver.said(LOOK_AGAIN_S) == REST or rests


def _switch_off(task: Task, profiles: Sequence[Profile]) -> str | None:
    """Bring every device to its safe state; None, or what went wrong, whatever it was: nothing may end the guardian."""
    problem = None
    for guarded, profile in zip(task.devices, profiles, strict=True):
        try:
            with open_transport(guarded.url, profile.serial_settings(), exclusive=False) as transport:
                device = device_on(transport, profile, guarded.unit_id, guarded.identity)
                device.check_identity()
                device.enter_safe_state()
        except Exception as error:  # noqa: BLE001
            problem = f"the heater is NOT confirmed off yet ({error}): cut its supply"
    return problem


def _tell(what: bytes) -> None:
    with contextlib.suppress(OSError):  # the driver is gone, or does not listen
        os.write(DRIVER_FD, what)


def _say(text: str) -> None:
    """To the terminal, which may be gone, or stalled: nobody waits for it for long."""
    line = f"smadrive guardian: {text}\n".encode()

    def write() -> None:
        with contextlib.suppress(OSError):
            os.write(TERMINAL_FD, line)

    writer = threading.Thread(target=write, daemon=True)
    writer.start()
    writer.join(TERMINAL_WITHIN_S)


def main() -> None:
    """Read the task and all that it needs, say that it is ready, watch."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGPIPE):
        signal.signal(number, signal.SIG_IGN)  # it ends when the driver does
    os.set_blocking(DRIVER_FD, False)
    driver = Pipe(0)
    line = driver.read_line()
    if not line:
        return  # the driver ended before it knew whom to guard
    task = Task.from_json(line)
    profiles = [load_profile(guarded.profile) for guarded in task.devices]
    _tell(READY)
    guard(task, profiles, driver)


if __name__ == "__main__":
    main()
