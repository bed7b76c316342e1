"""A heater board, which takes a command and returns all measurements in one transaction.

One exchange is one FC23 request. It writes the command (a new sequence number, current, enable) and reads all
measurements, with the echo of the sequence number. The echo proves that the measurements are younger than the command.

The sequence starts at a random number and never uses small numbers. The registers next to the echo (state, faults,
limits) hold small numbers. Otherwise, in a reply that is shifted by one register, such a number could be taken for the
echo.
"""

from __future__ import annotations

from math import isfinite, nan
from random import SystemRandom

from smadrive.clock import Clock
from smadrive.devices.device import Device
from smadrive.devices.heating.device_source import DeviceSource
from smadrive.devices.heating.heat_source import HeaterLimits, Sample, Supplied
from smadrive.devices.profile.readings import RegisterReading, problem_of
from smadrive.errors import ExceptionReply, ProtocolError, SafetyError
from smadrive.modbus.verdict import ExceptionCode

LOST_SENSOR = "sensor_bus"
"""The fault of a board that a sensor does not answer. Boards with old firmware then show the current 0 A, and an old
temperature, so neither is believed while the fault is latched."""
STALE_S = 0.5
"""Longest time in s without a new sample before the temperature is invalid. A board converts at least every 0.1 s."""

SEQUENCES = range(0x0100, 0x10000)
"""The sequence numbers. The registers next to the echo hold only smaller numbers."""


def next_sequence(number: int) -> int:
    """Return the sequence number after `number`. The first follows the last."""
    return number + 1 if number + 1 in SEQUENCES else SEQUENCES[0]


_MEASURED = (
    "sequence_echo",
    "status",
    "faults",
    "limits",
    "temperature",
    "measured_current",
    "measured_voltage",
    "displacement",
    "sample_counter",
)


class HeaterBoard(DeviceSource[Device]):
    """A heater board as heat source, with the interface HeatSource.

    The profile of the device names the register of each role, such as heater_current. ConfigError when the profile
    names no register for a role.
    """

    measures = frozenset(("temperature", "displacement"))
    has_watchdog = True
    has_temperature_limit = True

    def __init__(self, device: Device, clock: Clock) -> None:
        """Nothing is sent yet."""
        super().__init__(device)
        profile = device.profile
        self._clock = clock
        self._names = {role: profile.role(role) for role in _MEASURED}
        self._reads = tuple(self._names.values())
        self._sequence_name = profile.role("sequence")
        self._current_name = profile.role("heater_current")
        self._enable_name = profile.role("heater_enable")
        self._sequence = SystemRandom().choice(SEQUENCES)
        self._counter = nan
        self._counter_since_s = clock.now_s()
        self._has_converted = False

    def connect(self) -> None:
        """Prove the identity of the board, write its safe state, and start the check of its sample counter."""
        super().connect()
        self._counter, self._counter_since_s, self._has_converted = nan, self._clock.now_s(), False

    def configure(self, limits: HeaterLimits, watchdog_s: float) -> None:
        """Prove the identity again, then set watchdog and limits of the board, confirmed by read-back."""
        self.device.check_identity()
        self._write_limit("watchdog_s", watchdog_s, "watchdog_s")
        self._write_limit("temperature_max", limits.temperature_max_c, "temperature_max_c")
        self._write_limit("current_max", limits.current_max_a, "current_max_a")

    def arm(self) -> None:
        """Arm the board by a write to its `arm` register; SafetyError when it does not arm.

        A board that has restarted since `configure` has the limits of its firmware until the next run. During this run
        only the driver enforces those of the rig.
        """
        self._write_key("arm")
        status = self._names["status"]
        if "armed" not in (words := self.device.read((status,), proved=True)[status].words):
            raise SafetyError(
                "the device did not arm", where=status, value=", ".join(words), cure="clear the faults of the device"
            )
        self._armed = True

    def exchange(self, current_a: float, *, proved: bool = True) -> Supplied:  # noqa: ARG002  (the echo always proves it)
        """Command `current_a` and measure, in one transaction; see HeatSource.

        The echo of the sequence number proves the reply. ProtocolError when the echo differs from the number just sent:
        the measurements then belong to another exchange and are discarded.
        """
        self._sequence = next_sequence(self._sequence)
        command = {
            self._sequence_name: self._sequence,
            self._current_name: current_a,
            self._enable_name: 1 if self._armed else 0,
        }
        readings = self.device.exchange(command, self._reads)
        now_s = self._clock.now_s()
        self._check_echo(readings[self._names["sequence_echo"]])
        return self._supplied(now_s, {role: readings[name] for role, name in self._names.items()})

    def clear_faults(self) -> None:
        """Clear the latched faults; the board keeps the faults whose cause persists."""
        self._write_key("fault_clear")

    def _check_echo(self, echo: RegisterReading) -> None:
        if echo.raw != self._sequence:
            self.device.client.distrust()
            raise ProtocolError(
                "discarded, because the reply echoes another sequence number",
                where=f"unit {self.device.unit_id}",
                value=f"{echo.raw}, sent {self._sequence}",
            )

    def _supplied(self, now_s: float, readings: dict[str, RegisterReading]) -> Supplied:
        problem = self._temperature_fault(now_s, readings)
        armed = "armed" in readings["status"].words
        self._armed = self._armed and armed
        faults = readings["faults"].words
        is_lost = LOST_SENSOR in faults
        return Supplied(
            nan if is_lost else readings["measured_current"].value,
            nan if is_lost else readings["measured_voltage"].value,
            armed,
            faults,
            readings["limits"].words,
            Sample(readings["temperature"].value if problem is None else nan, now_s, problem),
            Sample(readings["displacement"].value, now_s, readings["displacement"].invalid),
            LOST_SENSOR if is_lost else problem_of(readings, ("measured_current", "measured_voltage")),
        )

    def _temperature_fault(self, now_s: float, readings: dict[str, RegisterReading]) -> str | None:
        """Return the reason why the temperature is invalid (a fault of the device, or no new conversion), or None."""
        counter = readings["sample_counter"].value
        if isfinite(counter) and counter != self._counter:
            self._has_converted = isfinite(self._counter)
            self._counter, self._counter_since_s = counter, now_s
        invalid, faults = readings["temperature"].invalid, readings["faults"].words
        if invalid is not None:
            named = [fault for fault in faults if fault.startswith(("thermocouple", "cold_junction"))]
            return ", ".join(named) or (LOST_SENSOR if LOST_SENSOR in faults else invalid)
        if LOST_SENSOR in faults and not self._has_converted:
            return LOST_SENSOR
        stale_s = now_s - self._counter_since_s
        return f"no new conversion for {stale_s:.2f} s" if stale_s > STALE_S else None

    def _write_limit(self, role: str, value: float, key: str) -> None:
        """Write a limit; `key` is its key in the rig file. ExceptionReply with a cure when the board allows less."""
        try:
            self.device.write(self.device.profile.role(role), value)
        except ExceptionReply as rejection:
            if rejection.code == ExceptionCode.ILLEGAL_VALUE:
                rejection.cure = f"lower limits.{key} in the rig file: the device itself allows less"
            raise

    def _write_key(self, role: str) -> None:
        """Write the key of the register with this role: the only value in its enum, and the only value it accepts."""
        name = self.device.profile.role(role)
        (key,) = self.device.profile.register(name).enum
        self.device.write(name, key)
