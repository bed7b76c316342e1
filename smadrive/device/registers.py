"""One register of a device: raw 16-bit words <-> a value in engineering units.

    value = raw · scale + offset        raw = round((value − offset) / scale), refused outside [min, max] and the type

Sentinels ("sensor open") are compared on the raw pattern, before any arithmetic: a sentinel never becomes a number.
Raw numbers are the register's own type: signed for int16, so −30000 and 0x8AD0 are the same pattern; both may be
written in a profile.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from functools import cached_property
from math import isfinite, nan
from typing import Literal, NamedTuple

from pydantic import Field, field_validator, model_validator

from smadrive.configfile import Section
from smadrive.errors import ConfigError

Table = Literal["holding", "input"]
Kind = Literal["uint16", "int16", "uint32", "int32", "float32"]

_CODES: dict[Kind, str] = {"uint16": "H", "int16": "h", "uint32": "I", "int32": "i", "float32": "f"}
_FLOAT32_MAX = 3.4028234663852886e38


class Reading(NamedTuple):
    """A register as read. `value` is NaN and `invalid` says why when the device has no value to give.

    `words` are the names of an enum's state or of the bits that are set.
    """

    raw: int | float
    value: float
    invalid: str | None = None
    words: tuple[str, ...] = ()


class Register(Section):
    """One entry of a profile's `[registers.NAME]`; `min`, `max`, `valid_min`, `valid_max` are in engineering units."""

    table: Table
    address: int = Field(ge=0, le=0xFFFF)
    type: Kind
    word_order: Literal["big", "little"] = "big"
    scale: float = 1.0
    offset: float = 0.0
    unit: str = ""
    access: Literal["r", "w", "rw"]
    min: float | None = None
    max: float | None = None
    enum: dict[int, str] = Field(default_factory=dict)
    bits: dict[int, str] = Field(default_factory=dict)
    invalid: dict[int, str] = Field(default_factory=dict)
    valid_min: float | None = None
    valid_max: float | None = None
    evidence: str = ""

    @field_validator("enum", "bits", "invalid", mode="before")
    @classmethod
    def _numbered(cls, table: dict[str, str]) -> dict[int, str]:
        """TOML keys are text: accept 32768, 0x8000 and -32768."""
        return {int(key, 0): word for key, word in table.items()}

    @field_validator("scale")
    @classmethod
    def _invertible(cls, scale: float) -> float:
        if scale == 0.0:
            raise ValueError("scale must not be zero")
        return scale

    @model_validator(mode="after")
    def _writable_within_limits(self) -> Register:
        limits = self.min is not None and self.max is not None
        if self.writable and not (limits or self.enum or self.bits):
            raise ValueError("a writable register needs min and max, so that nothing harmful can be written")
        if self.table == "input" and self.writable:
            raise ValueError("an input register cannot be written; access must be 'r'")
        if self.min is not None and self.max is not None and self.min > self.max:
            raise ValueError(f"min {self.min:g} exceeds max {self.max:g}")
        for limit in (self.min, self.max):
            if limit is not None:
                self._raw_of(limit)
        for bits in self.invalid:
            self.pattern(bits)
        return self

    @property
    def writable(self) -> bool:
        """Whether the device lets it be written."""
        return self.access != "r"

    @cached_property
    def size(self) -> int:
        """How many 16-bit registers it spans."""
        return 1 if self.type in ("uint16", "int16") else 2

    @cached_property
    def addresses(self) -> range:
        """The addresses it spans."""
        return range(self.address, self.address + self.size)

    def decode(self, words: Sequence[int]) -> Reading:
        """The reading in `words`, as they come from the bus."""
        raw = self._unpack(words)
        if self._plain:
            return Reading(raw, raw * self.scale + self.offset)
        if self.invalid and (reason := self._sentinels.get(tuple(words))):
            return Reading(raw, nan, reason)
        value = raw * self.scale + self.offset
        if not isfinite(value):
            return Reading(raw, nan, f"not a number (0x{words[0]:04X} ...)")
        if self.valid_min is not None and value < self.valid_min:
            return Reading(raw, nan, f"{value:g} {self.unit} is below the valid range, {self.valid_min:g}")
        if self.valid_max is not None and value > self.valid_max:
            return Reading(raw, nan, f"{value:g} {self.unit} is above the valid range, {self.valid_max:g}")
        return self._named(raw, value) if self.enum or self.bits else Reading(raw, value)

    def encode(self, value: float, name: str) -> tuple[int, ...]:
        """The words that carry `value`; ConfigError when not finite, outside [min, max] or no state of the enum."""
        if not isfinite(value):
            raise ConfigError(f"register '{name}': {value} cannot be written; give a finite number")
        if self.min is not None and self.max is not None and not self.min <= value <= self.max:
            raise ConfigError(
                f"register '{name}': {value:g} {self.unit} is outside the limits {self.min:g} to {self.max:g}"
            )
        try:
            raw = self._raw_of(value)
        except ValueError as error:
            raise ConfigError(f"register '{name}': {error}") from None
        if self.enum and raw not in self.enum:
            states = ", ".join(f"{number} = {word}" for number, word in self.enum.items())
            raise ConfigError(f"register '{name}': {value:g} is no state of it; there are: {states}")
        return self.pack(raw)

    def pack(self, raw: float) -> tuple[int, ...]:
        """The words of a raw number."""
        if self.size == 1:
            return (int(raw) & 0xFFFF,)
        words = struct.unpack(f">{self.size}H", struct.pack(f">{_CODES[self.type]}", raw))
        return words if self.word_order == "big" else words[::-1]

    def pattern(self, bits: int) -> tuple[int, ...]:
        """The words of a raw pattern, written as a number of the register's type or as its unsigned bits."""
        width = 16 * self.size
        if not -(1 << width - 1) <= bits < 1 << width:
            raise ValueError(f"the pattern {bits:#x} does not fit {self.type}")
        words = struct.unpack(f">{self.size}H", (bits & (1 << width) - 1).to_bytes(2 * self.size, "big"))
        return words if self.word_order == "big" else words[::-1]

    def _unpack(self, words: Sequence[int]) -> int | float:
        if self.type == "uint16":
            return words[0]
        if self.type == "int16":
            return words[0] - 0x10000 if words[0] & 0x8000 else words[0]
        high, low = words if self.word_order == "big" else (words[1], words[0])
        raw: int | float = struct.unpack(f">{_CODES[self.type]}", struct.pack(">HH", high, low))[0]
        return raw

    def _raw_of(self, value: float) -> int | float:
        exact = (value - self.offset) / self.scale
        raw = exact if self.type == "float32" else round(exact)
        if not self.lowest <= raw <= self.highest:
            raise ValueError(
                f"{value:g} {self.unit} is raw {raw:g}, which overflows {self.type} "
                f"({self.lowest:g} to {self.highest:g})"
            )
        return raw

    def _named(self, raw: float, value: float) -> Reading:
        number = int(raw)
        if self.bits:
            named = tuple(self.bits.get(bit, f"bit {bit}") for bit in range(16 * self.size) if number >> bit & 1)
            return Reading(raw, value, words=named)
        if number not in self.enum:
            return Reading(raw, nan, f"unknown state {number}")
        return Reading(raw, value, words=(self.enum[number],))

    @cached_property
    def _plain(self) -> bool:
        """Whether every pattern is a valid number and nothing else."""
        limited = self.valid_min is not None or self.valid_max is not None
        return not (self.invalid or self.enum or self.bits or limited or self.type == "float32")

    @cached_property
    def _sentinels(self) -> dict[tuple[int, ...], str]:
        return {self.pattern(bits): reason for bits, reason in self.invalid.items()}

    @cached_property
    def lowest(self) -> float:
        """The least raw number of the type."""
        if self.type == "float32":
            return -_FLOAT32_MAX
        return 0 if self.type.startswith("u") else -(1 << 16 * self.size - 1)

    @cached_property
    def highest(self) -> float:
        """The greatest raw number of the type."""
        if self.type == "float32":
            return _FLOAT32_MAX
        return (1 << 16 * self.size - (0 if self.type.startswith("u") else 1)) - 1
