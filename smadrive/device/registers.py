"""One register of a device: raw 16-bit words <-> a value in engineering units.

    value = raw · scale + offset        raw = round((value − offset) / scale), refused outside [min, max] and the type

Sentinels ("sensor open") are compared on the raw pattern, before any arithmetic: a sentinel never becomes a number.
Raw numbers are the register's own type: signed for int16, so −30000 and 0x8AD0 are the same pattern; both may be
written in a profile.

What other registers say of this one (its sign, its decimals, its unit) comes in as a `Context`: `companions.py`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property, lru_cache
from math import inf, isfinite, nan
from typing import Any, Literal

from pydantic import Field, field_validator, model_validator

from smadrive.configfile import Section
from smadrive.device import words as bus
from smadrive.device.readings import ALONE, Context, Reading
from smadrive.device.words import Kind, Order
from smadrive.errors import ConfigError

Table = Literal["holding", "input", "coil", "discrete"]
Evidence = Literal["own", "two", "one", "uncertain", ""]

STATES = 64
"""So many patterns of a register of states or flags are remembered: to name one takes longer than to read it."""


class Register(Section):
    """One entry of a profile's `[registers.NAME]`; `min`, `max`, `valid_min`, `valid_max` are in engineering units."""

    table: Table
    address: int = Field(ge=0, le=0xFFFF)
    type: Kind
    length: int = Field(default=0, ge=0, le=125)
    word_order: Order = "big"
    count: int = Field(default=1, ge=1, le=256)
    stride: int = Field(default=0, ge=0)
    scale: float = 1.0
    scale_from: str | None = None
    offset: float = 0.0
    sign_register: str | None = None
    unit: str = ""
    unit_from: str | None = None
    access: Literal["r", "w", "rw"]
    min: float | None = None
    max: float | None = None
    enum: dict[int, str] = Field(default_factory=dict)
    bits: dict[int, str] = Field(default_factory=dict)
    invalid: dict[int, str] = Field(default_factory=dict)
    valid_min: float | None = None
    valid_max: float | None = None
    valid_when: dict[str, tuple[int, ...]] = Field(default_factory=dict)
    block: str | None = None
    nonvolatile: bool | Literal["unknown"] = False
    evidence: Evidence = ""

    @field_validator("enum", "bits", "invalid", mode="before")
    @classmethod
    def _numbered(cls, table: dict[Any, str]) -> dict[int, str]:
        """TOML keys are text: accept 32768, 0x8000 and -32768."""
        return {int(key, 0) if isinstance(key, str) else key: word for key, word in table.items()}

    @field_validator("scale")
    @classmethod
    def _invertible(cls, scale: float) -> float:
        if scale == 0.0:
            raise ValueError("scale must not be zero")
        return scale

    @model_validator(mode="after")
    def _sensible(self) -> Register:
        if (self.table in ("coil", "discrete")) != (self.type == "bool"):
            raise ValueError(f"type '{self.type}' in table '{self.table}': coils and discrete inputs are 'bool'")
        if (self.type == "string") != (self.length > 0):
            raise ValueError("a string, and nothing else, has a length: the number of its registers")
        if self.writable:
            self._check_writable()
        if self.nonvolatile and self.access != "rw":
            raise ValueError("a nonvolatile register is compared before it is written: access must be 'rw'")
        for limit in (self.min, self.max):
            if limit is not None and self.scale_from is None:
                self._raw_of(limit, ALONE)
        for bits, reason in self.invalid.items():
            self._check_sentinel(bits, reason)
        return self

    @property
    def writable(self) -> bool:
        """Whether the device lets it be written."""
        return self.access != "r"

    @cached_property
    def companions(self) -> tuple[str, ...]:
        """The registers that say what this one means."""
        named = (self.scale_from, self.sign_register, self.unit_from, *self.valid_when)
        return tuple(name for name in named if name is not None)

    @cached_property
    def exchangeable(self) -> bool:
        """Whether it may be written again and again, together with others, without a look at any other register."""
        return not (self.nonvolatile or self.companions or self.block)

    @cached_property
    def size(self) -> int:
        """How many addresses it spans."""
        return self.length or (2 if bus.is_wide(self.type) else 1)

    @cached_property
    def addresses(self) -> range:
        """The addresses it spans."""
        return range(self.address, self.address + self.size)

    def decode(self, words: Sequence[int], context: Context = ALONE) -> Reading:
        """The reading in `words`, as they come from the bus."""
        if self._plain:
            raw = self._unpack(words)
            return Reading(raw, raw * self.scale + self.offset)
        if context is ALONE and (self.enum or self.bits):
            return self._state(tuple(words))
        return self._decoded(words, context)

    def encode(self, value: float, name: str, context: Context = ALONE) -> tuple[int, ...]:
        """The words that carry `value`; ConfigError when not finite, outside [min, max] or no state of the enum."""
        if not isfinite(value):
            raise ConfigError(f"register '{name}': {value} cannot be written; give a finite number")
        if self.min is not None and self.max is not None and not self.min <= value <= self.max:
            raise ConfigError(
                f"register '{name}': {value:g} {self.unit} is outside the limits {self.min:g} to {self.max:g}"
            )
        try:
            raw = self._raw_of(value, context)
        except ValueError as error:
            raise ConfigError(f"register '{name}': {error}") from None
        if self.enum and raw not in self.enum:
            states = ", ".join(f"{number} = {word}" for number, word in self.enum.items())
            raise ConfigError(f"register '{name}': {value:g} is no state of it; there are: {states}")
        return self.pack(raw)

    @cached_property
    def pack(self) -> Callable[[float], tuple[int, ...]]:
        """What makes the words of a raw number."""
        return bus.packer(self.type, self.word_order)

    def pattern(self, bits: int) -> tuple[int, ...]:
        """The words of a raw pattern."""
        return bus.pattern(self.type, self.word_order, bits)

    def saturated(self, value: float, context: Context = ALONE) -> tuple[int, ...]:
        """The words by which a device shows `value`: at the end of the type's range when it exceeds it."""
        lowest, highest = self._range
        raw = self._rounded(value, context)
        return self.pack(lowest if raw < lowest else min(raw, highest))

    def _decoded(self, words: Sequence[int], context: Context) -> Reading:
        """By all the rules there are."""
        if self.type == "string":
            return Reading(0, nan, None, (bus.text(words),))
        raw = self._unpack(words)
        if self.invalid and (reason := self._sentinels.get(tuple(words))):
            return Reading(raw, nan, reason)
        value = self._value_of(raw, context)
        if (problem := context.problem or self._implausible(value)) is not None:
            return Reading(raw, nan, problem)
        return self._named(raw, value) if self.enum or self.bits else Reading(raw, value)

    @cached_property
    def _state(self) -> Callable[[tuple[int, ...]], Reading]:
        """What decodes a register of states or flags that needs no other."""
        return lru_cache(STATES)(lambda words: self._decoded(words, ALONE))

    @cached_property
    def _unpack(self) -> Callable[[Sequence[int]], int | float]:
        """What finds the raw number in words."""
        return bus.unpacker(self.type, self.word_order)

    def _value_of(self, raw: float, context: Context) -> float:
        if context is ALONE:
            return raw * self.scale + self.offset
        value = context.sign * (raw * (context.scale or self.scale) + self.offset)
        return (value - 32) / 1.8 if context.fahrenheit else value

    def _rounded(self, value: float, context: Context) -> float:
        if context is ALONE:
            exact = (value - self.offset) / self.scale
        else:
            given = value * 1.8 + 32 if context.fahrenheit else value
            exact = (context.sign * given - self.offset) / (context.scale or self.scale)
        return exact if self.type == "float32" else round(exact)

    def _raw_of(self, value: float, context: Context) -> float:
        raw = self._rounded(value, context)
        lowest, highest = self._range
        if not lowest <= raw <= highest:
            raise ValueError(
                f"{value:g} {self.unit} is raw {raw:g}, which overflows {self.type} ({lowest:g} to {highest:g})"
            )
        return raw

    def _implausible(self, value: float) -> str | None:
        """Why `value` is none."""
        if not isfinite(value):
            return "not a number"
        if self.valid_min is not None and value < self.valid_min:
            return f"{value:g} {self.unit} is below the valid range, {self.valid_min:g}"
        if self.valid_max is not None and value > self.valid_max:
            return f"{value:g} {self.unit} is above the valid range, {self.valid_max:g}"
        return None

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
        return not (
            self.invalid or self.enum or self.bits or limited or self.companions or self.type in ("float32", "string")
        )

    @cached_property
    def _range(self) -> tuple[float, float]:
        """The raw numbers of the type."""
        return bus.RANGES[self.type]

    @cached_property
    def _sentinels(self) -> dict[tuple[int, ...], str]:
        return {self.pattern(bits): reason for bits, reason in self.invalid.items()}

    def _check_writable(self) -> None:
        """What is written must be able to be right, and unable to do harm."""
        limits = self.min is not None and self.max is not None
        if not (limits or self.enum or self.bits or self.type == "bool"):
            raise ValueError("a writable register needs min and max, so that nothing harmful can be written")
        if self.table in ("input", "discrete"):
            raise ValueError(f"table '{self.table}' cannot be written; access must be 'r'")
        if self.type == "string" or self.sign_register is not None:
            raise ValueError("a string or a sign-magnitude pair is not written; access must be 'r'")
        if self.evidence == "uncertain":
            raise ValueError("what is uncertain is not written; access must be 'r' until evidence is 'one' or 'two'")
        if self.min is not None and self.max is not None and self.min > self.max:
            raise ValueError(f"min {self.min:g} exceeds max {self.max:g}")

    def _check_sentinel(self, bits: int, reason: str) -> None:
        """A sentinel that is a valid value as well would make a true reading disappear."""
        value = self._value_of(self._unpack(self.pattern(bits)), ALONE)
        for low, high in ((self.valid_min, self.valid_max), (self.min, self.max)):
            stated = low is not None or high is not None
            inside = (-inf if low is None else low) <= value <= (inf if high is None else high)
            if stated and inside and self.scale_from is None:
                raise ValueError(
                    f"the sentinel {bits:#x} ('{reason}') is {value:g} {self.unit}, inside the valid range: narrow "
                    "valid_min and valid_max"
                )
