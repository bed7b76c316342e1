"""The board under test: the safety checks use its registers by name, and send it commands with sequence numbers."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from math import inf
from random import SystemRandom
from typing import NamedTuple

from smadrive.devices.device import Device
from smadrive.devices.heating.board import SEQUENCES, next_sequence
from smadrive.devices.profile.readings import RegisterReading
from smadrive.errors import DeviceError

_MEASURED = ("sequence_echo", "state", "faults", "limits", "temperature", "measured_current", "sample_counter")
_SETTINGS = ("watchdog_s", "temperature_max", "current_max")
POLL_S = 0.005
SETTLE_S = 0.05
"""Time in s after which a board has checked its sensors anew, for example after a limit was changed."""

Readings = dict[str, RegisterReading]


class TimeBounds(NamedTuple):
    """Bounds of a measured time, in s: the true time lies between them."""

    shortest_s: float
    longest_s: float


class CheckedBoard:
    """The board behind `device`. All times are in s, by the clock of this computer."""

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
        """Command `current_a` with the heater enabled, and return the readings of state and sensors.

        If `is_new` is True, the command has a new sequence number, otherwise the number of the previous command.
        """
        if is_new:
            self._sequence = next_sequence(self._sequence)
        command = {"sequence": self._sequence, "heater_current": current_a, "heater_enable": 1}
        return self.device.exchange(command, _MEASURED)

    def write_key(self, name: str) -> None:
        """Write the key of the register `name`, the only value that this register accepts."""
        (key,) = self.device.profile.register(name).enum
        self.device.write(name, key)

    def make_ready(self) -> None:
        """Switch off and clear the faults. DeviceError if a fault stays: no check could arm the board then."""
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
        """Make the board ready and write `settings`. Yield the values that all settings had before.

        At the end, switch the board off, restore its settings and clear the faults.
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
        """Call `act`; return its result and the times before and after the call. The board acted between these."""
        began_s = self.clock.now_s()
        return act(), began_s, self.clock.now_s()

    def fault_after(
        self, name: str, within_s: float, begin: Callable[[], Readings], observe: Callable[[], Readings]
    ) -> TimeBounds:
        """Call `begin`, then `observe` until the fault `name` is latched or `within_s` have passed.

        Return bounds of the time from `begin` to the fault. Without a fault, the longest time is infinite. Delays of
        this computer make the bounds wider, but the true time still lies between them.
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
