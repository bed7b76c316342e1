"""The one way to heat: every ampere goes through `HeaterBoard.exchange`.

One exchange is one FC23: it writes the command (a new sequence number, current, enable) and reads all measurements,
in which the device echoes the sequence number. The echo proves that the measurements are younger than the command.

The current is held to [0, current_max_a], and to zero while the board is not armed, the last temperature was invalid or
at its maximum, or the command is no number. The device has limits and a watchdog of its own; arming sets them too.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite, nan

from smadrive.clock import Clock
from smadrive.device.device import Device
from smadrive.device.readings import Reading
from smadrive.errors import ConfigError, ProtocolError, SafetyError
from smadrive.measurement import Measurement

STALE_S = 0.5  # the device converts at least every 0.1 s; a counter that stands still this long is a dead sensor

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
_SPAN_FILLERS = ("cold_junction",)


@dataclass(frozen=True, slots=True)
class HeaterLimits:
    """What the host never commands beyond, whatever the device would allow."""

    current_max_a: float
    temperature_max_c: float

    def __post_init__(self) -> None:
        """Refuse limits that limit nothing."""
        if not (isfinite(self.current_max_a) and self.current_max_a > 0):
            raise ConfigError(f"current_max_a is {self.current_max_a}; it must be a positive number of amperes")
        if not isfinite(self.temperature_max_c):
            raise ConfigError(f"temperature_max_c is {self.temperature_max_c}; it must be a number of degrees Celsius")


class HeaterBoard:
    """An SMA heater board: a Device whose profile binds the roles of command and measurement.

    Raises ConfigError when the profile lacks a role. Every method raises TransportError, ProtocolError or DeviceError
    when the talk with the device fails; the device's watchdog then turns the heater off.
    """

    def __init__(self, device: Device, limits: HeaterLimits, clock: Clock) -> None:
        """Nothing is sent yet; call `connect()`."""
        profile = device.profile
        self.device = device
        self.limits = limits
        self._clock = clock
        self._names = {role: profile.role(role) for role in _MEASURED}
        fillers = [name for role in _SPAN_FILLERS if (name := getattr(profile.roles, role)) is not None]
        self._reads = tuple(self._names.values()) + tuple(fillers)
        self._sequence_name = profile.role("sequence")
        self._current_name = profile.role("heater_current")
        self._enable_name = profile.role("heater_enable")
        self._sequence = 0
        self._armed = False
        self._heatable = False
        self._counter = -1
        self._counter_since_s = clock.now_s()

    @property
    def armed(self) -> bool:
        """Whether the device was armed at the last exchange."""
        return self._armed

    def connect(self) -> Measurement:
        """Prove the device's identity, bring it to its safe state and measure. It is not armed then."""
        self.device.check_identity()
        self.enter_safe_state()
        echo = self._names["sequence_echo"]
        self._sequence = int(self.device.read((echo,))[echo].raw)
        self._counter_since_s = self._clock.now_s()
        return self.exchange(0.0)

    def arm(self, watchdog_s: float) -> None:
        """Set the device's watchdog and limits, confirmed by read-back, then arm it.

        SafetyError when a fault is latched, the temperature is invalid or too high, or the device does not arm;
        ConfigError when the device cannot have such a watchdog or limit.
        """
        now = self.exchange(0.0)
        if now.device_faults:
            raise SafetyError(
                f"not armed, latched on the device: {', '.join(now.device_faults)}: remove the cause, clear the faults"
            )
        if not self._heatable:
            hot = f"{now.temperature_c:.1f} °C, the limit is {self.limits.temperature_max_c:g} °C"
            raise SafetyError(f"not armed: the temperature does not allow it: {now.temperature_fault or hot}")
        profile = self.device.profile
        self.device.write(profile.role("watchdog_s"), watchdog_s)
        self.device.write(profile.role("temperature_max"), self.limits.temperature_max_c)
        self.device.write(profile.role("current_max"), self.limits.current_max_a)
        self._turn_key("arm")
        status = self._names["status"]
        if "armed" not in (words := self.device.read((status,))[status].words):
            raise SafetyError(f"not armed: the device stays in state {', '.join(words)}")
        self._armed = True

    def exchange(self, current_a: float) -> Measurement:
        """Command `current_a`, held to the limits, and measure, in one transaction.

        A current that is no number is sent as zero, then SafetyError is raised. ProtocolError when the echoed sequence
        number is not the one just sent: the measurements are then not of this exchange and are discarded.
        """
        allowed_a = self._allowed(current_a)
        self._sequence = (self._sequence + 1) & 0xFFFF
        command = {
            self._sequence_name: self._sequence,
            self._current_name: allowed_a,
            self._enable_name: 1 if self._armed else 0,
        }
        readings = self.device.exchange(command, self._reads)
        now_s = self._clock.now_s()
        self._check_echo(readings[self._names["sequence_echo"]])
        measurement = self._measurement(now_s, {role: readings[name] for role, name in self._names.items()})
        if not isfinite(current_a):
            raise SafetyError(f"a current of {current_a} A was commanded; zero was sent: check the controller")
        return measurement

    def disarm(self) -> Measurement:
        """Enter the safe state and measure; SafetyError when the device still claims to be armed."""
        self.enter_safe_state()
        measurement = self.exchange(0.0)
        if measurement.armed:
            raise SafetyError("the device stays armed after its safe state was written: cut the heater's supply")
        return measurement

    def enter_safe_state(self) -> None:
        """Zero current and heater off, confirmed by read-back; tried several times, raises when unconfirmed."""
        self._armed = False
        self.device.enter_safe_state()

    def clear_faults(self) -> Measurement:
        """Clear the latched faults; SafetyError names those that persist. The board is not armed afterwards."""
        self.enter_safe_state()
        self._turn_key("fault_clear")
        measurement = self.exchange(0.0)
        if measurement.device_faults:
            raise SafetyError(f"not cleared, the cause persists: {', '.join(measurement.device_faults)}")
        return measurement

    def _allowed(self, current_a: float) -> float:
        if not (self._armed and self._heatable and isfinite(current_a)):
            return 0.0
        return min(max(current_a, 0.0), self.limits.current_max_a)

    def _check_echo(self, echo: Reading) -> None:
        if echo.raw != self._sequence:
            self._heatable = False
            self.device.master.distrust()
            raise ProtocolError(
                f"unit {self.device.unit_id}: the reply echoes sequence {echo.raw}, {self._sequence} was sent: a stale "
                "reply, discarded"
            )

    def _measurement(self, now_s: float, readings: dict[str, Reading]) -> Measurement:
        temperature = readings["temperature"]
        faults = readings["faults"].words
        problem = self._temperature_fault(now_s, readings)
        temperature_c = temperature.value if problem is None else nan
        self._heatable = temperature_c < self.limits.temperature_max_c  # False for NaN
        self._armed = self._armed and "armed" in readings["status"].words
        return Measurement(
            time_s=now_s,
            temperature_c=temperature_c,
            current_a=readings["measured_current"].value,
            voltage_v=readings["measured_voltage"].value,
            displacement_mm=readings["displacement"].value,
            temperature_fault=problem,
            device_faults=faults,
            device_limits=readings["limits"].words,
            armed="armed" in readings["status"].words,
        )

    def _temperature_fault(self, now_s: float, readings: dict[str, Reading]) -> str | None:
        """Why the temperature cannot be used: the device says so, or its sensor stopped converting."""
        counter = int(readings["sample_counter"].raw)
        if counter != self._counter:
            self._counter, self._counter_since_s = counter, now_s
        named = [fault for fault in readings["faults"].words if fault.startswith(("thermocouple", "cold_junction"))]
        invalid = readings["temperature"].invalid
        if invalid is not None:
            return ", ".join(named) or invalid
        stale_s = now_s - self._counter_since_s
        return f"no new conversion for {stale_s:.2f} s" if stale_s > STALE_S else None

    def _turn_key(self, role: str) -> None:
        """Write the only value that a key register takes."""
        name = self.device.profile.role(role)
        (key,) = self.device.profile.register(name).enum
        self.device.write(name, key)
