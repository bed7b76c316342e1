"""The interface of a heat source: heater board, bench supply or TCLab."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, isfinite, nan
from typing import NamedTuple, Protocol

from smadrive.devices.identity import Identity
from smadrive.errors import ConfigError


class Sample(NamedTuple):
    """The value of a sensor at `time_s`; NaN, with the reason in `problem`, when it has no valid value."""

    value: float
    time_s: float
    problem: str | None = None


@dataclass(frozen=True, slots=True)
class HeaterLimits:
    """Limits that the host never exceeds, also where the device would allow more."""

    current_max_a: float
    temperature_max_c: float
    voltage_max_v: float = inf

    def __post_init__(self) -> None:
        """ConfigError for limits that limit nothing."""
        if not (isfinite(self.current_max_a) and self.current_max_a > 0):
            raise _no_limit("current_max_a", self.current_max_a, "a positive number of amperes")
        if not isfinite(self.temperature_max_c):
            raise _no_limit("temperature_max_c", self.temperature_max_c, "a number of degrees Celsius")
        if not self.voltage_max_v > 0:
            raise _no_limit("voltage_max_v", self.voltage_max_v, "a positive number of volts")


def _no_limit(name: str, value: float, needed: str) -> ConfigError:
    return ConfigError("limits nothing", where=name, value=value, cure=f"set it to {needed}")


class Supplied(NamedTuple):
    """The answer of a heat source to a command: current and voltage of the period that ends, and its present state.

    `armed` is the present state of the device, also when another program armed it. `temperature` and `displacement` are
    None where the source does not measure them. An unknown current or voltage is NaN, with the reason in `problem`.
    """

    current_a: float = nan
    voltage_v: float = nan
    armed: bool = False
    faults: tuple[str, ...] = ()
    limits: tuple[str, ...] = ()
    temperature: Sample | None = None
    displacement: Sample | None = None
    problem: str | None = None


class HeatSource(Protocol):
    """A device that drives current through the wire. `Heater` is the only caller of `exchange`.

    Methods raise TransportError, ProtocolError or DeviceError when the communication with the device fails.
    """

    measures: frozenset[str]
    """The quantities that it measures itself: temperature, displacement, both or none."""
    has_watchdog: bool
    """Whether it switches off by itself when no request arrives."""
    settle_s: float
    """Time that its output takes to reach a new command."""

    @property
    def identity(self) -> Identity:
        """The registers that distinguish it from its twin, once it is connected; empty where no register does."""
        ...

    @property
    def armed(self) -> bool:
        """Whether it was armed at every exchange since `arm`. If not, it heats again only after another `arm`."""
        ...

    def connect(self) -> None:
        """Prove its identity and bring it to its safe state."""
        ...

    def configure(self, limits: HeaterLimits, watchdog_s: float) -> None:
        """Set its limits and its watchdog, confirmed by read-back; ConfigError when it cannot take them."""
        ...

    def arm(self) -> None:
        """Arm it at zero current; SafetyError when it does not arm."""
        ...

    def exchange(self, current_a: float, *, proved: bool = False) -> Supplied:
        """Command `current_a` (zero while it is not armed) and measure; `proved`: the reply cannot be an older one."""
        ...

    def enter_safe_state(self) -> None:
        """Zero current and output off, confirmed by read-back; tried several times, raises when unconfirmed."""
        ...

    def clear_faults(self) -> None:
        """Clear the latched faults."""
        ...
