"""The interface of a heat source: heater board, bench supply or TCLab."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, isfinite, nan
from typing import NamedTuple, Protocol

from smadrive.devices.identity import Identity
from smadrive.errors import ConfigError


class Sample(NamedTuple):
    """The value of a sensor at `time_s`. An invalid value is NaN, and `problem` is the reason."""

    value: float
    time_s: float
    problem: str | None = None


@dataclass(frozen=True, slots=True)
class HeaterLimits:
    """The limits of the rig, which the driver keeps even if the device would allow more.

    Without a voltage limit, `voltage_max_v` is infinite. The current is at most `holding_a` while the thermometer is
    silent: this current holds the wire at `temperature_max_c`, or is infinite.
    """

    current_max_a: float
    temperature_max_c: float
    voltage_max_v: float = inf
    holding_a: float = inf

    def __post_init__(self) -> None:
        """Raise ConfigError if a limit has no effect. Only the voltage limit may be infinite."""
        if not (isfinite(self.current_max_a) and self.current_max_a > 0):
            raise _no_limit("current_max_a", self.current_max_a, "a positive number of amperes")
        if not isfinite(self.temperature_max_c):
            raise _no_limit("temperature_max_c", self.temperature_max_c, "a number of degrees Celsius")
        if not self.voltage_max_v > 0:
            raise _no_limit("voltage_max_v", self.voltage_max_v, "a positive number of volts")


def _no_limit(name: str, value: float, needed: str) -> ConfigError:
    return ConfigError("this limit has no effect", where=name, value=value, cure=f"set {name} to {needed}")


class Supplied(NamedTuple):
    """The answer of a heat source to a command.

    current_a, voltage_v         of the period that just ended; NaN if unknown
    armed                        state of the device at present; another program may have armed it
    faults                       names of the faults of the device
    limits                       names of the limits of the device that lower the current
    temperature, displacement    None if the source does not measure the quantity
    problem                      reason why current or voltage is unknown; None if both are known
    setting_a                    current setting of this period, read back; None if the source does not report it
    """

    current_a: float = nan
    voltage_v: float = nan
    armed: bool = False
    faults: tuple[str, ...] = ()
    limits: tuple[str, ...] = ()
    temperature: Sample | None = None
    displacement: Sample | None = None
    problem: str | None = None
    setting_a: float | None = None


class HeatSource(Protocol):
    """A device that drives current through the wire. Only `Heater` commands a current above zero.

    Methods raise TransportError, ProtocolError or DeviceError when the communication with the device fails.
    """

    measures: frozenset[str]
    """The quantities that the source itself measures: temperature, displacement, both or none."""
    has_watchdog: bool
    """True if the source switches off by itself when no new command arrives."""
    has_temperature_limit: bool
    """True if the source switches off by itself when the temperature that it measures exceeds `temperature_max_c`."""
    settle_s: float
    """Time in seconds that the output takes to reach a new command."""

    @property
    def identity(self) -> Identity:
        """The values of the registers that distinguish the device from others of its type.

        The result is empty before `connect`, and for a device without such registers.
        """
        ...

    @property
    def armed(self) -> bool:
        """True if the source was armed at every exchange since `arm`. Otherwise it heats only after another `arm`."""
        ...

    def connect(self) -> None:
        """Prove the identity of the device and write its safe state."""
        ...

    def configure(self, limits: HeaterLimits, watchdog_s: float) -> None:
        """Set limits and watchdog of the device, confirmed by read-back; ConfigError if the device cannot keep them."""
        ...

    def arm(self) -> None:
        """Arm the source at zero current; SafetyError when it does not arm."""
        ...

    def exchange(self, current_a: float, *, proved: bool = False) -> Supplied:
        """Command `current_a` (zero while the source is not armed) and measure.

        If `proved` is True, the reply is proved to belong to this command, by an echo or a counter. Otherwise a late
        reply to an older command may be taken for the right reply.
        """
        ...

    def forget_command(self) -> None:
        """Forget the last command, so that the next exchange sends its command even if it is the same."""
        ...

    def send_safe_state(self) -> None:
        """Send the safe state at once, without waiting for replies, if the source does not answer any more.

        Call this only when `enter_safe_state` follows. Nothing is sent to a source that answers.
        """
        ...

    def enter_safe_state(self) -> None:
        """Set zero current and switch the output off. Try several times; raise an error if no read-back confirms it."""
        ...

    def clear_faults(self) -> None:
        """Clear the latched faults."""
        ...
