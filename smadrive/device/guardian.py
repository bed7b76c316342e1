"""The guardian: a process that outlives the driver and switches the heat source off when the driver no longer can.

A bench supply without a watchdog heats on when its driver is killed, stands still or crashes. So the driver starts this
process beside itself and writes it a byte at every use of a port, through a pipe:

    w   watch: heating begins        b   a beat: the driver lives        r   rest: the driver needs no guardian now
    g   gives way: the driver has heard that it is taken over, and has let its connections go

Every byte is echoed, so that the driver knows that the guardian lives too. While it watches, no byte for `timeout_s`,
or the end of the pipe, means that the driver is gone: the guardian opens the ports itself (it needs no lock for that)
and writes the safe state until every device has confirmed it. Two masters on one line would take each other's replies
for their own: a driver that only stood still finds `t` (taken over) in the other pipe when it wakes, before it uses a
port. It lets its connections go and says `g`, then `r`, and waits; the guardian looks once more, in case one last
command slipped through. Every `r` is answered by `f` (free): the ports are the driver's, and the guardian is ready to
watch again. From its start it needs no file and no terminal.

A serial port can be opened beside a driver that stands still. A device or gateway behind a socket may have room for one
client only, and that is the driver as long as it lives. Where the guardian fails there, it waits `timeout_s` more: a
driver that wakes gives way in that time, also where its guardian stood still with it (a wait so interrupted goes on for
what was left of it). One that says nothing is ended (SIGKILL), whatever else lives in its process, and the
guardian takes the freed socket. A device that is unplugged looks the same from here, and the driver is ended in vain;
but were it spared, it would still hold the way in when the plug is back. Only the parent is ended, and only while it is
that: the guardian of a driver that has ended is another's child, and the driver's number may be a stranger's.

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
from typing import NamedTuple

from smadrive.device.anydevice import device_on
from smadrive.device.identity import Identity
from smadrive.device.profile import Profile, load_profile
from smadrive.modbus.connect import is_remote, open_transport

WATCH, BEAT, REST, GIVES_WAY = b"w", b"b", b"r", b"g"
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


class Driver:
    """The parent process: what it says through a pipe, without waiting longer than told, and its end.

    To be made before READY is told: the driver, which waits for that, is certainly the parent then.
    """

    def __init__(self, descriptor: int) -> None:
        self._descriptor = descriptor
        self._pid = os.getppid()
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

    def kill(self) -> None:
        """End the process, if it is still the parent, and await that its connections are closed."""
        if os.getppid() == self._pid:
            _say(f"the driver gives no sign of life and may hold the only connection: ending it (process {self._pid})")
            with contextlib.suppress(OSError):
                os.kill(self._pid, signal.SIGKILL)
            self.said(LOOK_AGAIN_S)


def guard(task: Task, profiles: Sequence[Profile], driver: Driver) -> None:
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


def _take_over(task: Task, profiles: Sequence[Profile], driver: Driver, reason: str) -> None:
    """Safe state, confirmed; then again and again while a driver that stood still may still wake and command."""
    _tell(TAKEN)
    give_up_s = time.monotonic() + GIVE_UP_S
    told = ""
    gives_way = rests = False
    while time.monotonic() < give_up_s:
        problem = _switch_off(task, profiles)
        if not told:
            _say(f"the driver {reason} while heating: taking over")
        news = problem.text if problem else "heater off, confirmed by read-back"
        if news != told:
            _say(news)
            told = news
        if problem is None and (rests or driver.ended):
            _tell(FREE)
            return
        may_bar = problem is not None and problem.is_remote and not (gives_way or driver.ended)
        said = driver.said(task.timeout_s if may_bar else LOOK_AGAIN_S)
        rests = rests or said == REST
        gives_way = gives_way or said in (GIVES_WAY, REST)
        if may_bar and not (said or driver.ended):
            driver.kill()
    _say(f"giving up after {GIVE_UP_S / 60:g} min; the last: {told}")


class _Problem(NamedTuple):
    text: str
    is_remote: bool


def _switch_off(task: Task, profiles: Sequence[Profile]) -> _Problem | None:
    """Bring every device to its safe state; None, or what went wrong, whatever it was: nothing may end the guardian."""
    problem = None
    for guarded, profile in zip(task.devices, profiles, strict=True):
        try:
            with open_transport(guarded.url, profile.serial_settings(), exclusive=False) as transport:
                device = device_on(transport, profile, guarded.unit_id, guarded.identity)
                device.check_identity()
                device.enter_safe_state()
        except Exception as error:  # noqa: BLE001
            text = f"the heater is NOT confirmed off yet ({error}): cut its supply"
            problem = _Problem(text, is_remote(guarded.url) or (problem is not None and problem.is_remote))
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
    driver = Driver(0)
    line = driver.read_line()
    if not line:
        return  # the driver ended before it knew whom to guard
    task = Task.from_json(line)
    profiles = [load_profile(guarded.profile) for guarded in task.devices]
    _tell(READY)
    guard(task, profiles, driver)


if __name__ == "__main__":
    main()
