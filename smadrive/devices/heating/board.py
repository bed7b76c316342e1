"""A heater board: command and all measurements in one transaction.

One exchange is one FC23: it writes the command (a new sequence number, current, enable) and reads all measurements
with the echo of the sequence number. The echo proves that the measurements are younger than the command.

The sequence starts at random and is never a small number. The registers next to the echo (state, faults, limits) hold
small numbers: in a reply that is shifted by one register one of them could otherwise be taken for the echo.
"""

from __future__ import annotations

from math import isfinite, nan
from random import SystemRandom

from smadrive.clock import Clock
from smadrive.devices.device import Device
from smadrive.devices.heating.heat_source import HeaterLimits, Sample, Supplied
from smadrive.devices.identity import Identity
from smadrive.devices.profile.readings import RegisterReading, problem_of
from smadrive.errors import ProtocolError, SafetyError

STALE_S = 0.5
"""The device converts at least every 0.1 s: when its counter stands still for so long, the sensor is dead."""

SEQUENCES = range(0x0100, 0x10000)
"""Numbers above those that the registers next to the echo may hold."""

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


class HeaterBoard:
    """A Device whose profile binds the roles of command and measurement; see HeatSource.

    Raises ConfigError when the profile lacks a role.
    """

    measures = frozenset(("temperature", "displacement"))
    has_watchdog = True

    def __init__(self, device: Device, clock: Clock) -> None:
        """Nothing is sent yet."""
        profile = device.profile
        self.device = device
        self.settle_s = profile.timing.settle_ms / 1e3
        self._clock = clock
        self._names = {role: profile.role(role) for role in _MEASURED}
        self._reads = tuple(self._names.values())
        self._sequence_name = profile.role("sequence")
        self._current_name = profile.role("heater_current")
        self._enable_name = profile.role("heater_enable")
        self._sequence = SystemRandom().choice(SEQUENCES)
        self._armed = False
        self._counter = -1.0
        self._counter_since_s = clock.now_s()

    @property
    def identity(self) -> Identity:
        """See HeatSource."""
        return self.device.identity

    @property
    def armed(self) -> bool:
        """Whether the board was armed at every exchange since `arm`."""
        return self._armed

    def connect(self) -> None:
        """Prove the board's identity and bring it to its safe state."""
        self.device.check_identity()
        self.enter_safe_state()
        self._counter_since_s = self._clock.now_s()

    def configure(self, limits: HeaterLimits, watchdog_s: float) -> None:
        """Prove the identity anew; set the board's watchdog and limits, confirmed by read-back."""
        self.device.check_identity()
        profile = self.device.profile
        self.device.write(profile.role("watchdog_s"), watchdog_s)
        self.device.write(profile.role("temperature_max"), limits.temperature_max_c)
        self.device.write(profile.role("current_max"), limits.current_max_a)

    def arm(self) -> None:
        """Write the arm key; SafetyError when the board does not arm."""
        self._write_key("arm")
        status = self._names["status"]
        if "armed" not in (words := self.device.read((status,), proved=True)[status].words):
            raise SafetyError("not armed, the device stays in its state", where=status, value=", ".join(words))
        self._armed = True

    def exchange(self, current_a: float, *, proved: bool = True) -> Supplied:  # noqa: ARG002  (the echo always proves it)
        """Command `current_a` and measure, in one transaction, proved by the echo of its sequence number.

        ProtocolError when the echoed sequence number is not the one just sent: the measurements are then not of this
        exchange and are discarded.
        """
        self._sequence = self._sequence + 1 if self._sequence + 1 in SEQUENCES else SEQUENCES[0]
        command = {
            self._sequence_name: self._sequence,
            self._current_name: current_a,
            self._enable_name: 1 if self._armed else 0,
        }
        readings = self.device.exchange(command, self._reads)
        now_s = self._clock.now_s()
        self._check_echo(readings[self._names["sequence_echo"]])
        return self._supplied(now_s, {role: readings[name] for role, name in self._names.items()})

    def enter_safe_state(self) -> None:
        """See HeatSource."""
        self._armed = False
        self.device.enter_safe_state()

    def clear_faults(self) -> None:
        """Clear the faults whose cause is gone."""
        self._write_key("fault_clear")

    def _check_echo(self, echo: RegisterReading) -> None:
        if echo.raw != self._sequence:
            self.device.client.distrust()
            raise ProtocolError(
                "discarded, the reply is stale: it echoes another sequence number than was sent",
                where=f"unit {self.device.unit_id}",
                value=f"{echo.raw}, sent {self._sequence}",
            )

    def _supplied(self, now_s: float, readings: dict[str, RegisterReading]) -> Supplied:
        problem = self._temperature_fault(now_s, readings)
        armed = "armed" in readings["status"].words
        self._armed = self._armed and armed
        return Supplied(
            readings["measured_current"].value,
            readings["measured_voltage"].value,
            armed,
            readings["faults"].words,
            readings["limits"].words,
            Sample(readings["temperature"].value if problem is None else nan, now_s, problem),
            Sample(readings["displacement"].value, now_s, readings["displacement"].invalid),
            problem_of(readings, ("measured_current", "measured_voltage")),
        )

    def _temperature_fault(self, now_s: float, readings: dict[str, RegisterReading]) -> str | None:
        """The reason why the temperature is invalid: a fault of the device, or no new conversion; None: it is valid."""
        counter = readings["sample_counter"].value
        if isfinite(counter) and counter != self._counter:
            self._counter, self._counter_since_s = counter, now_s
        invalid = readings["temperature"].invalid
        if invalid is not None:
            named = [fault for fault in readings["faults"].words if fault.startswith(("thermocouple", "cold_junction"))]
            return ", ".join(named) or invalid
        stale_s = now_s - self._counter_since_s
        return f"no new conversion for {stale_s:.2f} s" if stale_s > STALE_S else None

    def _write_key(self, role: str) -> None:
        """Write the only value that a key register accepts."""
        name = self.device.profile.role(role)
        (key,) = self.device.profile.register(name).enum
        self.device.write(name, key)
