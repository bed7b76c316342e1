"""A device profile: one TOML file with everything that a driver must know about one type of device.

The driver and the simulator use the same file. Everything that could lead to a wrong value or a harmful write is an
error when the file is loaded, for every variant of the device.
"""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import Any, Literal, Self

from pydantic import Field, field_validator, model_validator

from smadrive.devices.profile import validation
from smadrive.devices.profile.dependent_registers import check_dependencies
from smadrive.devices.profile.golden_frames import check_golden_frame
from smadrive.devices.profile.register import Register
from smadrive.devices.profile.schema import (
    DeviceTiming,
    Forbidden,
    GoldenFrame,
    Head,
    IdentityRegister,
    Roles,
    SafeWrite,
    Serial,
    Tcp,
    Variant,
    WriteOrder,
)
from smadrive.devices.profile.variants import applied, expanded, refuse_ambiguity
from smadrive.errors import ConfigError
from smadrive.files.config import Section, parse_config, read_config_text
from smadrive.files.kinds import PROFILE
from smadrive.files.number_text import parse_whole
from smadrive.files.shipped import config_file
from smadrive.files.spelling import suggestion_or_list
from smadrive.modbus.bus import BusTiming
from smadrive.modbus.transports.transport import SerialSettings

QUANTITIES = ("temperature", "displacement", "measured_current", "measured_voltage")


class Profile(Section):
    """The profile of one type of device. Its fields are the tables of the file; see docs/device-profiles.md."""

    schema_: Literal[1] = Field(alias="schema")
    profile: Head
    serial: Serial | None = None
    tcp: Tcp | None = None
    timing: DeviceTiming
    identify: tuple[IdentityRegister, ...] = ()
    roles: Roles = Roles()
    registers: dict[str, Register] = Field(default_factory=dict)
    variants: tuple[Variant, ...] = ()
    forbidden: tuple[Forbidden, ...] = ()
    write_order: tuple[WriteOrder, ...] = ()
    safe_state: tuple[SafeWrite, ...] = ()
    golden_frames: tuple[GoldenFrame, ...] = Field(default=(), alias="vectors")

    @field_validator("identify", mode="before")
    @classmethod
    def _one_or_several(cls, value: Any) -> Any:
        return [value] if isinstance(value, dict) else value

    @field_validator("registers")
    @classmethod
    def _channels(cls, registers: dict[str, Register]) -> dict[str, Register]:
        return expanded(registers)

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        line = "tcp" if self.profile.protocol == "modbus-tcp" else "serial"
        if getattr(self, line) is None:
            raise ValueError(f"protocol '{self.profile.protocol}' needs the table [{line}]")
        if bool(self.registers) != self.has_registers:
            verb = "needs" if self.has_registers else "has no"
            raise ValueError(f"protocol '{self.profile.protocol}' {verb} [registers.NAME]")
        if self.has_registers:
            self._check_map()
        return self

    @property
    def has_registers(self) -> bool:
        """True if the device has Modbus registers. A device without them needs a driver class of its own."""
        return self.profile.protocol.startswith("modbus")

    def _check_map(self) -> None:
        self._check_names()
        refuse_ambiguity(self.variants)
        for registers in (self.registers, *(applied(self.registers, variant) for variant in self.variants)):
            self._check_registers(registers)
        if self.profile.heats:
            validation.check_ends_heat(self.profile.role, self.safe_state, self.roles, self.registers)
        for golden in self.golden_frames:
            check_golden_frame(golden, self.registers)

    @property
    def proves_type(self) -> bool:
        """True if the device can prove its type, by registers with `ranges` or by the banner of a text protocol."""
        return not self.has_registers or any(proof.ranges for proof in self.identify)

    @property
    def measured(self) -> tuple[str, ...]:
        """The names of the registers that contain measured temperature, displacement, current and voltage."""
        bound = (getattr(self.roles, role) for role in QUANTITIES)
        return tuple(name for name in bound if name is not None)

    @property
    def unit_id(self) -> int:
        """The factory setting of the unit id."""
        line = self.tcp if self.profile.protocol == "modbus-tcp" else self.serial
        assert line is not None  # checked at load
        return line.unit_id

    def register(self, name: str) -> Register:
        """Return the register `name`. ConfigError, with the nearest name as its cure, if the profile has none."""
        try:
            return self.registers[name]
        except KeyError:
            raise ConfigError(
                f"no register '{name}'", where=self._where, cure=suggestion_or_list(name, self.registers)
            ) from None

    def role(self, role: str) -> str:
        """Return the name of the register that has this role; ConfigError if no register has it."""
        name: str | None = getattr(self.roles, role)
        if name is None:
            cure = f'name its register in [roles]: {role} = "REGISTER"'
            raise ConfigError(f"no register for the role '{role}'", where=self._where, cure=cure)
        return name

    def as_variant(self, variant: Variant) -> Profile:
        """Return a profile with the registers of this variant only.

        Its `identify` contains the raw values of `variant.match`, so that a device of another variant is refused.
        """
        proofs = tuple(IdentityRegister(register=name, ranges=[span]) for name, span in variant.match.items())
        others = tuple(proof for proof in self.identify if proof.register_ not in variant.match)
        registers, roles = applied(self.registers, variant), self.roles.without(variant.absent)
        changes = {"registers": registers, "roles": roles, "identify": others + proofs, "variants": ()}
        return self.model_copy(update=changes)

    def chosen(self, choice: str) -> Profile:
        """Return the profile of the variant `choice`, or of the model if `choice` is a raw value (`model_id=60120`).

        ConfigError if there is no such variant or model, or several such models.
        """
        if "=" in choice:
            return self._pinned(choice)
        choices = {variant.choice: variant for variant in self.variants if variant.choice}
        if choice not in choices:
            raise ConfigError(
                f"no choice '{choice}'", where=self._where, cure=suggestion_or_list(choice, map(str, choices))
            )
        return self.as_variant(choices[choice])

    def bus_timing(self) -> BusTiming:
        """Return the timing for a client, in seconds."""
        timing = self.timing
        return BusTiming(
            response_timeout_s=timing.response_timeout_ms / 1e3,
            min_gap_s=timing.min_gap_ms / 1e3,
            post_write_s=timing.post_write_ms / 1e3,
            interval_s=timing.poll_interval_ms / 1e3,
            silence=timing.silence,
            read_retries=timing.retries,
        )

    def serial_settings(self) -> SerialSettings | None:
        """Return the serial settings for a transport; None for a device without a serial line."""
        line = self.serial
        return None if line is None else SerialSettings(line.baudrate, line.parity, line.stopbits)

    def _pinned(self, choice: str) -> Profile:
        """Return the profile of the model with the raw values in `choice`, such as `model_id=60120`.

        The device must then prove these raw values.
        """
        raws = dict(_raw_of(pair, choice) for pair in choice.split(","))
        for name, raw in raws.items():
            self.register(name)
            allowed = [span for proof in self.identify if proof.register_ == name for span in proof.ranges]
            if allowed and not any(first <= raw <= last for first, last in allowed):
                raise ConfigError("no model has this value", where=self._where, value=f"{name} = {raw}")
        near = [one for one in self.variants if all(one.holds(name, raw) for name, raw in raws.items())]
        for name in (name for variant in near for name in variant.match if name not in raws):
            raise ConfigError(
                f"'{choice}' fits several models", where=self._where, cure=f"add ,{name}=RAW to '{choice}'"
            )
        model = self.as_variant(near[0]) if near else self.model_copy(update={"variants": ()})
        others = tuple(proof for proof in model.identify if proof.register_ not in raws)
        proofs = tuple(IdentityRegister(register=name, ranges=[(raw, raw)]) for name, raw in raws.items())
        return model.model_copy(update={"identify": others + proofs})

    @property
    def _where(self) -> str:
        return f"profile '{self.profile.id}'"

    def _check_names(self) -> None:
        validation.check_proofs(self.identify, self.registers)
        for variant in self.variants:
            for name in variant.match:
                validation.find_register(name, self.registers, "variants.match")
        for role, bound in self.roles.model_dump(exclude_none=True).items():
            validation.find_register(bound, self.registers, f"roles.{role}")

    def _check_registers(self, registers: dict[str, Register]) -> None:
        validation.refuse_overlaps(registers)
        validation.refuse_forbidden(registers, self.forbidden)
        validation.refuse_unreachable(registers, self.timing)
        validation.refuse_torn_blocks(registers, self.timing)
        for name, register in registers.items():
            check_dependencies(name, register, registers)
        validation.check_order(self.write_order, registers)
        validation.check_safe_state(self.safe_state, self.write_order, registers)


def load_profile(name_or_path: str | Path) -> Profile:
    """Load the profile at a path (`*.toml`), or the shipped profile of that name.

    `NAME:CHOICE` selects a variant that no register shows, for example a thermocouple type, `adam-6018:J`.
    `NAME:REGISTER=RAW` selects the model with these raw values, for example `riden-rd60xx:model_id=60120`.
    ConfigError, with file, key and cure, if the file or the choice is wrong.
    """
    name, _, choice = str(name_or_path).partition(":")
    path = config_file(name, PROFILE)
    profile = _parsed(read_config_text(path), path)
    return profile.chosen(choice) if choice else profile


@lru_cache(maxsize=16)
def _parsed(text: str, path: Path) -> Profile:
    """Return the profile of the text. A rig loads a profile several times, and a campaign does so in every run."""
    return parse_config(text, path, Profile)


def _raw_of(pair: str, choice: str) -> tuple[str, int]:
    name, _, raw = pair.partition("=")
    try:
        return name.strip(), parse_whole(raw)
    except ValueError:
        raise ConfigError(
            "cannot be read",
            where=f"'{choice}'",
            value=pair,
            cure="write REGISTER=RAW with a whole number, and separate several of these by commas",
        ) from None
