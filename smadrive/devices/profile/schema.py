"""The tables of a profile, except the registers. docs/device-profiles.md explains every key with an example."""

from __future__ import annotations

from collections.abc import Collection
from typing import Literal

from pydantic import Field, field_validator, model_validator

from smadrive.devices.profile.function_codes import ALL_FUNCTIONS
from smadrive.devices.profile.register import Evidence, Table
from smadrive.files.config import Section
from smadrive.modbus.requests import MAX_READ_REGISTERS, MAX_WRITE_REGISTERS
from smadrive.modbus.transports.transport import Parity


class Head(Section):
    """Name, role, protocol and vendor of the device. `evidence` names the kind of sources of the register map."""

    id: str
    role: Literal["heater", "supply", "temperature", "displacement"]
    protocol: Literal["modbus-rtu", "modbus-tcp", "tclab"] = "modbus-rtu"
    vendor: str
    evidence: Evidence = ""

    @property
    def heats(self) -> bool:
        """True if the device drives current through the wire."""
        return self.role in ("heater", "supply")


class Serial(Section):
    """Factory settings of the line. A URL may replace baud rate, parity and stop bits, a rig file the unit id."""

    baudrate: int = Field(ge=50, le=12_000_000)
    bytesize: Literal[8] = 8
    parity: Parity = "N"
    stopbits: Literal[1, 2] = 1
    unit_id: int = Field(default=1, ge=1, le=247)


class Tcp(Section):
    """The unit id of a device that has its own network port. The connection URL contains host and port."""

    unit_id: int = Field(default=255, ge=0, le=255)


class DeviceTiming(Section):
    """The timing in ms, and the limits of requests, that a client must keep.

    The simulated device enforces `min_gap_ms`, `boot_ms`, the longest requests and the function codes; a simulated
    instrument also `update_ms`.
    """

    response_timeout_ms: float = Field(gt=0, le=60_000)
    min_gap_ms: float = Field(default=0.0, ge=0, le=60_000)
    post_write_ms: float = Field(default=0.0, ge=0, le=60_000)
    poll_interval_ms: float = Field(default=0.0, ge=0, le=60_000)
    boot_ms: float = Field(default=0.0, ge=0, le=60_000)
    opening_ms: float = Field(default=0.0, ge=0, le=60_000)
    settle_ms: float = Field(default=0.0, ge=0, le=60_000)
    update_ms: float = Field(default=0.0, ge=0, le=60_000)
    silence: bool = True
    retries: int = Field(default=2, ge=0, le=20)
    max_read_registers: int = Field(default=MAX_READ_REGISTERS, ge=1, le=MAX_READ_REGISTERS)
    max_write_registers: int = Field(default=MAX_WRITE_REGISTERS, ge=1, le=MAX_WRITE_REGISTERS)
    function_codes: tuple[int, ...] = ALL_FUNCTIONS

    @property
    def patience_s(self) -> float:
        """The longest silence of a device that may just have been powered, or reset by the opening of its port, s."""
        return max(self.boot_ms, self.opening_ms) / 1e3

    @field_validator("function_codes")
    @classmethod
    def _check_codes(cls, codes: tuple[int, ...]) -> tuple[int, ...]:
        if strange := set(codes) - set(ALL_FUNCTIONS):
            raise ValueError(
                f"function {min(strange)} is unknown; the known functions are {', '.join(map(str, ALL_FUNCTIONS))}"
            )
        return codes


class IdentityRegister(Section):
    """A register that proves the type of a device, because its raw value lies in `ranges`.

    Without ranges the register holds a serial number.
    """

    register_: str = Field(alias="register")
    ranges: list[tuple[int, int]] = Field(default_factory=list)


class Roles(Section):
    """The name of the register for each quantity and command that the driver or the simulated device uses."""

    temperature: str | None = None
    cold_junction: str | None = None
    heater_current: str | None = None
    heater_voltage: str | None = None
    heater_enable: str | None = None
    measured_current: str | None = None
    measured_voltage: str | None = None
    regulation: str | None = None
    ovp: str | None = None
    ocp: str | None = None
    boot_power: str | None = None
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
    estop: str | None = None
    current_gain: str | None = None
    current_offset: str | None = None
    voltage_gain: str | None = None
    voltage_offset: str | None = None
    source_gain: str | None = None
    source_offset: str | None = None
    calibration_save: str | None = None

    @property
    def measure_resistance(self) -> bool:
        """True if the device measures current and voltage."""
        return self.measured_current is not None and self.measured_voltage is not None

    def without(self, absent: Collection[str]) -> Roles:
        """Return the roles except those whose register is in `absent`."""
        bound = self.model_dump(exclude_none=True)
        return Roles(**{role: name for role, name in bound.items() if name not in absent})


class Override(Section):
    """The keys of a register that a variant changes."""

    address: int | None = Field(default=None, ge=0, le=0xFFFF)
    scale: float | None = None
    offset: float | None = None
    min: float | None = None
    max: float | None = None
    valid_min: float | None = None
    valid_max: float | None = None


class Variant(Section):
    """A model of the family. Raw values of registers identify it (`match`), or the user chooses it (`choice`).

    `absent` names the registers of the family that this model lacks.
    """

    match: dict[str, tuple[int, int]] = Field(default_factory=dict)
    choice: str | None = None
    registers: dict[str, Override]
    absent: tuple[str, ...] = ()
    evidence: Evidence = ""

    @model_validator(mode="after")
    def _one_way(self) -> Variant:
        if bool(self.match) == bool(self.choice):
            raise ValueError("a variant needs either match = { register = [first, last] } or choice = 'name'")
        return self

    def holds(self, name: str, raw: float) -> bool:
        """Return True if the register `name` identifies this model and `raw` is one of its values."""
        return name in self.match and self.match[name][0] <= raw <= self.match[name][1]


class Forbidden(Section):
    """Addresses, from `first` to `last`, that must never be written, and the reason."""

    table: Table
    first: int = Field(ge=0, le=0xFFFF)
    last: int = Field(ge=0, le=0xFFFF)
    reason: str


class WriteOrder(Section):
    """A rule about the order of writes.

    before    the register before which the rule applies; "*" stands for every register
    write     the register that must be written first
    value     the value that the register `write` must hold; the driver writes this value if necessary. Without a value,
              the caller must write the register `write` first, otherwise ConfigError is raised
    """

    before: str
    write: str
    value: float | None = None


class SafeWrite(Section):
    """One write of the safe state."""

    register_: str = Field(alias="register")
    value: float


class GoldenFrame(Section):
    """A recorded request and its response, in hexadecimal digits with CRC.

    `means` lists the values of the registers that the request writes or the response holds.
    """

    request: str
    response: str | None = None
    means: dict[str, float] = Field(default_factory=dict)
