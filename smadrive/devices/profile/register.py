"""The description of one register in a profile: table and address, conversion, limits of values to write.

A wrong description is an error when the profile is loaded. `codec.py` does the conversion.
"""

from __future__ import annotations

from functools import cached_property
from math import inf
from typing import Any, Literal

from pydantic import Field, field_validator, model_validator

from smadrive.devices.profile import register_types
from smadrive.devices.profile.codec import Codec
from smadrive.devices.profile.register_types import Kind, Order
from smadrive.files.config import Section
from smadrive.files.number_text import parse_whole

Table = Literal["holding", "input", "coil", "discrete"]
Evidence = Literal["own", "two", "one", "uncertain", ""]


class Register(Section):
    """One entry `[registers.NAME]` of a profile. `min`, `max`, `valid_min` and `valid_max` are in engineering units."""

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
        """Convert the keys to numbers. TOML keys are text, for example 32768, 0x8000 or -32768."""
        return {parse_whole(key) if isinstance(key, str) else key: word for key, word in table.items()}

    @field_validator("scale")
    @classmethod
    def _invertible(cls, scale: float) -> float:
        if scale == 0.0:
            raise ValueError("scale must not be zero")
        return scale

    @model_validator(mode="after")
    def _sensible(self) -> Register:
        if (self.table in ("coil", "discrete")) != (self.type == "bool"):
            raise ValueError(
                f"type '{self.type}' in table '{self.table}': coils and discrete inputs need type 'bool', other tables "
                "need another type"
            )
        if (self.type == "string") != (self.length > 0):
            raise ValueError("a string needs a length, its number of registers; other types have none")
        if self.writable:
            self._check_writable()
        if self.nonvolatile and self.access != "rw":
            raise ValueError("a nonvolatile register is read before it is written, so access must be 'rw'")
        for limit in (self.min, self.max):
            if limit is not None and self.scale_from is None:
                self.codec.check_fits(limit)
        for bits, reason in self.invalid.items():
            self._check_sentinel(bits, reason)
        return self

    @property
    def writable(self) -> bool:
        """True if the register can be written."""
        return self.access != "r"

    @cached_property
    def depends_on(self) -> tuple[str, ...]:
        """The names of the registers that determine the scale, sign, unit or validity of this register."""
        named = (self.scale_from, self.sign_register, self.unit_from, *self.valid_when)
        return tuple(name for name in named if name is not None)

    @cached_property
    def exchangeable(self) -> bool:
        """True if an FC23 exchange may write the register. False if it is nonvolatile, dependent or in a block."""
        return not (self.nonvolatile or self.depends_on or self.block)

    @cached_property
    def size(self) -> int:
        """The number of addresses that the register occupies."""
        return self.length or (2 if register_types.is_wide(self.type) else 1)

    @cached_property
    def addresses(self) -> range:
        """The addresses that the register occupies."""
        return range(self.address, self.address + self.size)

    @cached_property
    def codec(self) -> Codec:
        """The conversion between the words and the value of the register."""
        return Codec(
            self.type,
            self.word_order,
            scale=self.scale,
            offset=self.offset,
            unit=self.unit,
            writable=(self.min, self.max),
            valid=(self.valid_min, self.valid_max),
            enum=self.enum,
            bits=self.bits,
            invalid=self.invalid,
        )

    def _check_writable(self) -> None:
        """Raise ValueError if a write could be harmful or is impossible."""
        limits = self.min is not None and self.max is not None
        if not (limits or self.enum or self.bits or self.type == "bool"):
            raise ValueError("a writable register needs min and max, enum or bits, to exclude harmful values")
        if self.table in ("input", "discrete"):
            raise ValueError(f"table '{self.table}' cannot be written; access must be 'r'")
        if self.type == "string" or self.sign_register is not None:
            raise ValueError("a string or a sign-magnitude pair cannot be written; access must be 'r'")
        if self.evidence == "uncertain":
            raise ValueError(
                "evidence is 'uncertain', so this register must not be written: set access to 'r', or verify the "
                "register and set evidence to 'one' or 'two' (sources)"
            )
        if self.min is not None and self.max is not None and self.min > self.max:
            raise ValueError(f"min {self.min:g} exceeds max {self.max:g}")

    def _check_sentinel(self, bits: int, reason: str) -> None:
        """Raise ValueError if a sentinel lies in a valid range, because a correct reading would count as invalid."""
        value = self.codec.number(bits)
        for low, high in ((self.valid_min, self.valid_max), (self.min, self.max)):
            stated = low is not None or high is not None
            inside = (-inf if low is None else low) <= value <= (inf if high is None else high)
            if stated and inside and self.scale_from is None:
                raise ValueError(
                    f"the sentinel {bits:#x} ('{reason}') is {value:g} {self.unit}, inside the valid range: narrow "
                    "valid_min and valid_max"
                )
