"""A device profile: everything a driver must know of one type of device, in one TOML file.

The same file drives the real device and the simulated one. What could lead to a wrong value or a harmful write is
refused when the file is loaded: overlapping registers, limits that overflow, writes into forbidden ranges.
"""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Any, Literal

from pydantic import Field, field_validator, model_validator

from smadrive.configfile import Section, load_config, nearest
from smadrive.device.registers import Register, Table
from smadrive.errors import ConfigError
from smadrive.modbus.bus import BusTiming
from smadrive.modbus.requests import MAX_READ_REGISTERS
from smadrive.modbus.transport import Parity, SerialSettings
from smadrive.shipped import shipped_file


class Head(Section):
    """What the device is; `evidence` tells how well the map is known (own, two sources, one source)."""

    id: str
    role: Literal["heater", "supply", "temperature", "displacement"]
    protocol: Literal["modbus-rtu"] = "modbus-rtu"
    vendor: str
    evidence: str = ""


class Serial(Section):
    """The device's factory settings of its serial line; a connection URL may overrule all but `bytesize`."""

    baudrate: int = Field(gt=0)
    bytesize: Literal[8] = 8
    parity: Parity = "N"
    stopbits: Literal[1, 2] = 1
    unit_id: int = Field(default=1, ge=1, le=247)


class Timing(Section):
    """What the device needs of a master; `silence = false` drops the standard's pause between frames."""

    response_timeout_ms: float = Field(gt=0)
    min_gap_ms: float = Field(default=0.0, ge=0)
    silence: bool = True
    read_retries: int = Field(default=2, ge=0, le=10)
    max_read_registers: int = Field(default=MAX_READ_REGISTERS, ge=1, le=MAX_READ_REGISTERS)


class Identify(Section):
    """A register whose raw value proves that the device is the one described: it lies in one of `ranges`."""

    register_: str = Field(alias="register")
    ranges: list[tuple[int, int]] = Field(min_length=1)


class Roles(Section):
    """Which register plays which part for the driver."""

    temperature: str | None = None
    cold_junction: str | None = None
    heater_current: str | None = None
    heater_enable: str | None = None
    measured_current: str | None = None
    measured_voltage: str | None = None
    displacement: str | None = None
    status: str | None = None
    faults: str | None = None
    limits: str | None = None
    sequence: str | None = None
    sequence_echo: str | None = None
    sample_counter: str | None = None
    uptime: str | None = None
    arm: str | None = None
    fault_clear: str | None = None
    watchdog_s: str | None = None
    temperature_max: str | None = None
    current_max: str | None = None


class Forbidden(Section):
    """Addresses that are never written, and why."""

    table: Table
    first: int = Field(ge=0, le=0xFFFF)
    last: int = Field(ge=0, le=0xFFFF)
    reason: str


class SafeWrite(Section):
    """One write on the way to the safe state."""

    register_: str = Field(alias="register")
    value: float


class Profile(Section):
    """One device type."""

    schema_: Literal[1] = Field(alias="schema")
    profile: Head
    serial: Serial
    timing: Timing
    identify: tuple[Identify, ...] = ()
    roles: Roles = Roles()
    registers: dict[str, Register]
    forbidden: tuple[Forbidden, ...] = ()
    safe_state: tuple[SafeWrite, ...] = ()

    @field_validator("identify", mode="before")
    @classmethod
    def _one_or_several(cls, value: Any) -> Any:
        return [value] if isinstance(value, dict) else value

    @model_validator(mode="after")
    def _consistent(self) -> Profile:
        _refuse_overlaps(self.registers)
        for name, register in self.registers.items():
            _refuse_forbidden(name, register, self.forbidden)
        for identify in self.identify:
            _known(identify.register_, self.registers, "identify.register")
        for role, bound in self.roles.model_dump(exclude_none=True).items():
            _known(bound, self.registers, f"roles.{role}")
        if self.profile.role in ("heater", "supply") and not self.safe_state:
            raise ValueError(f"a {self.profile.role} needs [[safe_state]]: the writes that end all heating")
        for step in self.safe_state:
            _check_safe_write(step, self.registers)
        return self

    def register(self, name: str) -> Register:
        """The register `name`; ConfigError names the nearest one there is."""
        try:
            return self.registers[name]
        except KeyError:
            raise ConfigError(
                f"profile '{self.profile.id}' has no register '{name}'{nearest(name, self.registers)}"
            ) from None

    def role(self, role: str) -> str:
        """The name of the register that plays `role`; ConfigError when none does."""
        name: str | None = getattr(self.roles, role)
        if name is None:
            raise ConfigError(f"profile '{self.profile.id}' binds no register to the role '{role}': add it to [roles]")
        return name

    def bus_timing(self) -> BusTiming:
        """The timing as a master wants it."""
        timing = self.timing
        return BusTiming(
            response_timeout_s=timing.response_timeout_ms / 1e3,
            min_gap_s=timing.min_gap_ms / 1e3,
            silence=timing.silence,
            read_retries=timing.read_retries,
        )

    def serial_settings(self) -> SerialSettings:
        """The serial line as a transport wants it."""
        return SerialSettings(self.serial.baudrate, self.serial.parity, self.serial.stopbits)


def load_profile(name_or_path: str | Path) -> Profile:
    """The profile at a path (`*.toml`), or the shipped one of that name; ConfigError names file, key and cure."""
    path = Path(name_or_path)
    return load_config(path if path.suffix == ".toml" else shipped_file("devices", str(name_or_path)), Profile)


def _refuse_overlaps(registers: dict[str, Register]) -> None:
    for table in ("holding", "input"):
        ordered = sorted((register.address, name) for name, register in registers.items() if register.table == table)
        for (_, before), (address, after) in pairwise(ordered):
            last = registers[before].addresses[-1]
            if address <= last:
                raise ValueError(
                    f"registers.{after}.address {address} overlaps registers.{before}, which ends at {last}: "
                    "correct an address or a type"
                )
        if ordered and (last := registers[ordered[-1][1]].addresses[-1]) > 0xFFFF:
            raise ValueError(f"registers.{ordered[-1][1]} ends at {last}, beyond 65535: correct address or type")


def _refuse_forbidden(name: str, register: Register, forbidden: tuple[Forbidden, ...]) -> None:
    for zone in forbidden:
        inside = register.address <= zone.last and register.addresses[-1] >= zone.first
        if register.writable and register.table == zone.table and inside:
            raise ValueError(
                f"registers.{name}.access '{register.access}' at address {register.address} writes into the forbidden "
                f"range {zone.first} to {zone.last} ({zone.reason}): make it access = 'r'"
            )


def _known(name: str, registers: dict[str, Register], key: str) -> Register:
    if name not in registers:
        raise ValueError(f"{key} names the unknown register '{name}'{nearest(name, registers)}")
    return registers[name]


def _check_safe_write(step: SafeWrite, registers: dict[str, Register]) -> None:
    register = _known(step.register_, registers, "safe_state.register")
    if register.access != "rw":
        raise ValueError(
            f"safe_state.register '{step.register_}' has access '{register.access}': a safe state must be confirmed by "
            "read-back, so it needs 'rw'"
        )
    try:
        register.encode(step.value, step.register_)
    except ConfigError as error:
        raise ValueError(f"safe_state: {error}") from None
