"""What can heat a wire: a heater board or a bench supply, seen alike."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, isfinite, nan
from typing import NamedTuple, Protocol

from smadrive.devices.identity import Identity
from smadrive.errors import ConfigError


class Sample(NamedTuple):
    """A quantity as a sensor gave it at `time_s`; NaN, and `problem` says why, when it has no value to give."""

    value: float
    time_s: float
    problem: str | None = None


@dataclass(frozen=True, slots=True)
class HeaterLimits:
    """What the host never commands beyond, whatever the device would allow."""

    current_max_a: float
    temperature_max_c: float
    voltage_max_v: float = inf

    def __post_init__(self) -> None:
        """Refuse limits that limit nothing."""
        if not (isfinite(self.current_max_a) and self.current_max_a > 0):
            raise ConfigError(f"current_max_a is {self.current_max_a}; it must be a positive number of amperes")
        if not isfinite(self.temperature_max_c):
            raise ConfigError(f"temperature_max_c is {self.temperature_max_c}; it must be a number of degrees Celsius")
        if not self.voltage_max_v > 0:
            raise ConfigError(f"voltage_max_v is {self.voltage_max_v}; it must be a positive number of volts")


class Supplied(NamedTuple):
    """What a heat source says after a command: what it drove in the period that ends, and how it stands.

    `armed` is what it says of itself now, whoever armed it. `temperature` and `displacement` are None where the source
    measures no such thing. A current or voltage that the source cannot tell is NaN, and `problem` says why.
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

    Methods raise TransportError, ProtocolError or DeviceError when the talk with the device fails.
    """

    measures: frozenset[str]
    """Which of the quantities temperature and displacement it measures by itself."""
    has_watchdog: bool
    """Whether it switches off by itself when nobody talks to it."""
    settle_s: float
    """How long its output takes to reach a new command."""

    @property
    def identity(self) -> Identity:
        """What tells it from its twins, once it is connected; empty where nothing does."""
        ...

    @property
    def armed(self) -> bool:
        """Whether it was armed at every exchange since `arm`: one that was not takes an `arm` to heat again."""
        ...

    def connect(self) -> None:
        """Prove its identity and bring it to its safe state."""
        ...

    def configure(self, limits: HeaterLimits, watchdog_s: float) -> None:
        """Give it its limits and its watchdog, confirmed by read-back; ConfigError when it cannot have such ones."""
        ...

    def arm(self) -> None:
        """Let it heat, at zero current; SafetyError when it does not arm."""
        ...

    def exchange(self, current_a: float, *, proved: bool = False) -> Supplied:
        """Command `current_a` (zero while it is not armed) and measure; `proved`: no older reply is taken for this."""
        ...

    def enter_safe_state(self) -> None:
        """Zero current and output off, confirmed by read-back; tried several times, raises when unconfirmed."""
        ...

    def clear_faults(self) -> None:
        """Clear the latched faults."""
        ...
