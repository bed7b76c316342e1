"""A board on the desk, as the safety checks use it: by register names, with a sequence of its own."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from math import inf
from random import SystemRandom
from typing import NamedTuple

from smadrive.devices.device import Device
from smadrive.devices.heating.board import SEQUENCES
from smadrive.devices.profile.readings import RegisterReading
from smadrive.errors import DeviceError

_MEASURED = ("sequence_echo", "state", "faults", "limits", "temperature", "measured_current", "sample_counter")
_SETTINGS = ("watchdog_s", "temperature_max", "current_max")
POLL_S = 0.005
SETTLE_S = 0.05
"""After this time a board has checked its sensors."""

Readings = dict[str, RegisterReading]


class TimeBounds(NamedTuple):
    """The shortest and the longest time that something took, in s."""

    shortest_s: float
    longest_s: float


class CheckedBoard:
    """The board behind `device`. Times are those of the host's clock, in s."""

    def __init__(self, device: Device) -> None:
        self.device = device
        self.clock = device.client.clock
        self._sequence = SystemRandom().choice(SEQUENCES)

    def read(self, name: str) -> RegisterReading:
        """Return the reading of one register."""
        return self.device.read((name,), proved=True)[name]

    def measured(self) -> Readings:
        """Return the readings of state and sensors."""
        return self.device.read(_MEASURED)

    def command(self, current_a: float, *, is_new: bool = True) -> Readings:
        """Send a command that keeps the board enabled, and return the readings.

        If `is_new`, the command has a new sequence number.
        """
        if is_new:
            self._sequence = self._sequence + 1 if self._sequence + 1 in SEQUENCES else SEQUENCES[0]
        command = {"sequence": self._sequence, "heater_current": current_a, "heater_enable": 1}
        return self.device.exchange(command, _MEASURED)

    def write_key(self, name: str) -> None:
        """Write the only value that the register accepts."""
        (key,) = self.device.profile.register(name).enum
        self.device.write(name, key)

    def make_ready(self) -> None:
        """Switch off and clear the faults. DeviceError if a fault stays, because no check could arm the board."""
        self.device.enter_safe_state()
        self.write_key("fault_clear")
        self.wait(SETTLE_S)
        if faults := self.read("faults").words:
            raise DeviceError(
                "the board cannot be checked, because a fault stays",
                where=f"unit {self.device.unit_id}",
                value=", ".join(faults),
                cure="connect the thermocouple, release the emergency stop, calibrate the board; see the faults in "
                "docs/sma-reference.md",
            )

    @contextmanager
    def prepared(self, **settings: float) -> Iterator[dict[str, float]]:
        """Make the board ready with `settings`, and yield the settings before.

        At the end switch off, restore the settings and clear the faults.
        """
        self.make_ready()
        before = {name: self.read(name).value for name in _SETTINGS}
        try:
            for name, value in settings.items():
                self.device.write(name, value)
            yield before
        finally:
            self.device.enter_safe_state()
            for name, value in before.items():
                self.device.write(name, value)
            self.write_key("fault_clear")

    def arm(self) -> None:
        """Arm the board."""
        self.write_key("arm")

    def wait(self, duration_s: float) -> None:
        """Wait for `duration_s`."""
        self.clock.sleep_until(self.clock.now_s() + duration_s)

    def timed(self, act: Callable[[], Readings]) -> tuple[Readings, float, float]:
        """Return the result of `act`, and the times before and after it. The board acted between these times."""
        began_s = self.clock.now_s()
        return act(), began_s, self.clock.now_s()

    def fault_after(
        self, name: str, within_s: float, begin: Callable[[], Readings], observe: Callable[[], Readings]
    ) -> TimeBounds:
        """Call `begin`, then `observe` until the fault `name` is latched or `within_s` have passed.

        Return the shortest and the longest time from `begin` to the fault that agree with all observations. The longest
        is infinite without a fault. Delays of this computer make the bounds wider, never wrong.
        """
        _, begin_s, begun_s = self.timed(begin)
        shortest_s = 0.0
        while True:
            readings, sent_s, received_s = self.timed(observe)
            if name in readings["faults"].words:
                return TimeBounds(shortest_s, received_s - begin_s)
            shortest_s = sent_s - begun_s
            if shortest_s > within_s:
                return TimeBounds(shortest_s, inf)
            self.wait(POLL_S)
