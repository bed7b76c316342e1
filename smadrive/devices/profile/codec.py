"""The conversion between raw 16-bit words and a value in engineering units, by the register's entry in the profile.

    value = raw · scale + offset        raw = round((value − offset) / scale)

A value to write must lie in [min, max] and in the range of the type.

Sentinels ("sensor open") are compared as raw patterns, before any arithmetic, so a sentinel never becomes a number. A
profile may write a pattern as a number of the register's type or as an unsigned number: for int16, −30000 and 0x8AD0
are the same pattern.

Other registers may determine sign, scale, unit and validity. A `Context` contains this information
(dependent_registers.py).

Every exchange converts registers, so a codec is created once for each register. It has plain attributes, because
reading an attribute of a pydantic model takes six times as long.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from math import floor, isfinite, nan

from smadrive.devices.profile import register_types
from smadrive.devices.profile.readings import ALONE, Context, RegisterReading
from smadrive.devices.profile.register_types import Kind, Order
from smadrive.errors import ConfigError

Limits = tuple[float | None, float | None]

STATES = 64
"""Number of decoded patterns that are cached for a register with states or flags, whose decoding is slow."""

Rounding = Callable[[float], int]

WHOLE = 1e-6
"""A raw number counts as whole if it is this much below a whole number, because binary fractions are not exact."""


def down(exact: float) -> int:
    """Round down to a whole raw number: a command must not exceed its limit by a part of a step of the register."""
    return floor(exact + WHOLE)


class Codec:
    """Converts between the words and the value of one register.

    `kind` is the type, `order` the word order. `writable` is (min, max) and `valid` is (valid_min, valid_max), in
    engineering units. The other parameters have the names of the profile's keys.
    """

    def __init__(
        self,
        kind: Kind,
        order: Order,
        *,
        scale: float,
        offset: float,
        unit: str,
        writable: Limits,
        valid: Limits,
        enum: Mapping[int, str],
        bits: Mapping[int, str],
        invalid: Mapping[int, str],
    ) -> None:
        self.pack = register_types.packer(kind, order)
        self._unpack = register_types.unpacker(kind, order)
        self._kind, self._order = kind, order
        self._lowest, self._highest = register_types.RANGES.get(kind, (0, 0))
        self._scale, self._offset, self._unit = scale, offset, unit
        self._min, self._max = writable
        self._valid_min, self._valid_max = valid
        self._enum, self._bits = enum, bits
        self._sentinels = {self.pattern(pattern): reason for pattern, reason in invalid.items()}
        self._has_states = bool(enum or bits)
        ends = self._lowest * scale + offset, self._highest * scale + offset
        always_finite = kind not in register_types.NOT_A_NUMBER and all(map(isfinite, ends))
        self._is_plain = always_finite and not self._has_states and valid == (None, None)
        """True if every pattern except a sentinel is a number, and every number is a valid value."""
        self._state = lru_cache(STATES)(lambda words: self._decoded(words, ALONE))

    def decode(self, words: Sequence[int], context: Context = ALONE) -> RegisterReading:
        """Return the reading of `words`, which are in the order of the bus."""
        if context is ALONE:
            if self._is_plain and not (self._sentinels and tuple(words) in self._sentinels):
                raw = self._unpack(words)
                return RegisterReading(raw, raw * self._scale + self._offset)
            if self._has_states:
                return self._state(tuple(words))
        return self._decoded(words, context)

    def encode(self, value: float, name: str, context: Context = ALONE, rounding: Rounding = round) -> tuple[int, ...]:
        """Return the words for `value`. `rounding` makes the raw number of an integer register whole.

        ConfigError for a value that is not finite, not in [min, max], not in the range of the type, or not in the enum.
        """
        if not isfinite(value):
            raise _rejected("the value is not finite", name, value, cure="give a finite number")
        noise = WHOLE * abs(self._scale)  # 6.1 is 6100 steps of 0.001, and 6100 * 0.001 is a little more than 6.1
        if self._min is not None and self._max is not None and not self._min - noise <= value <= self._max + noise:
            limit = f"{self._min:g} to {self._max:g}"
            raise _rejected("the value is outside the limits", name, self._shown(value), limit)
        raw = self._raw_of(value, context, rounding)
        if not self._lowest <= raw <= self._highest:
            limit = f"raw {self._lowest:g} to {self._highest:g}"
            raise _rejected(f"the value overflows {self._kind}", name, f"{self._shown(value)}, raw {raw:g}", limit)
        if self._enum and raw not in self._enum:
            states = ", ".join(f"{number} = {word}" for number, word in self._enum.items())
            raise _rejected("the value is not a state of the register", name, f"{value:g}", states)
        return self.pack(raw)

    def saturated(self, value: float, context: Context = ALONE) -> tuple[int, ...]:
        """Return the words that a device sends when it measures `value`.

        A value outside the range of the type becomes the nearest end of this range.
        """
        raw = self._raw_of(value, context)
        if not self._lowest <= raw <= self._highest:
            raw = min(max(raw, self._lowest), self._highest)
        return self.pack(raw)

    def pattern(self, bits: int) -> tuple[int, ...]:
        """Return the words of the raw pattern `bits`."""
        return register_types.pattern(self._kind, self._order, bits)

    def check_fits(self, value: float) -> None:
        """Raise ValueError if the raw number of `value` lies outside the range of the type."""
        raw = self._raw_of(value, ALONE)
        if not self._lowest <= raw <= self._highest:
            raise ValueError(self._overflow(value, raw))

    def number(self, pattern: int) -> float:
        """Return the value of a raw pattern in the unit of the register; a sentinel is converted like any number."""
        return self._value_of(self._unpack(self.pattern(pattern)), ALONE)

    def _decoded(self, words: Sequence[int], context: Context) -> RegisterReading:
        """Return the reading, with all rules applied: text, sentinels, context, valid range, states and bits."""
        if self._kind == "string":
            return RegisterReading(0, nan, None, (register_types.text(words),))
        raw = self._unpack(words)
        if self._sentinels and (reason := self._sentinels.get(tuple(words))):
            return RegisterReading(raw, nan, reason)
        value = self._value_of(raw, context)
        if (problem := context.problem or self._implausible(value)) is not None:
            return RegisterReading(raw, nan, problem)
        return self._named(raw, value) if self._has_states else RegisterReading(raw, value)

    def _value_of(self, raw: float, context: Context) -> float:
        if context is ALONE:
            return raw * self._scale + self._offset
        value = context.sign * (raw * (context.scale or self._scale) + self._offset)
        return (value - 32) / 1.8 if context.fahrenheit else value

    def _raw_of(self, value: float, context: Context, rounding: Rounding = round) -> float:
        if context is ALONE:
            exact = (value - self._offset) / self._scale
        else:
            given = value * 1.8 + 32 if context.fahrenheit else value
            exact = (context.sign * given - self._offset) / (context.scale or self._scale)
        return exact if self._kind == "float32" else rounding(exact)

    def _shown(self, value: float) -> str:
        return f"{value:g} {self._unit}".rstrip()

    def _overflow(self, value: float, raw: float) -> str:
        return (
            f"{value:g} {self._unit} is raw {raw:g}, which overflows {self._kind} "
            f"({self._lowest:g} to {self._highest:g})"
        )

    def _implausible(self, value: float) -> str | None:
        """Return the reason why `value` is invalid; return None if it is valid."""
        if not isfinite(value):
            return "not a number"
        if self._valid_min is not None and value < self._valid_min:
            return f"{value:g} {self._unit} is below the valid range, {self._valid_min:g}"
        if self._valid_max is not None and value > self._valid_max:
            return f"{value:g} {self._unit} is above the valid range, {self._valid_max:g}"
        return None

    def _named(self, raw: float, value: float) -> RegisterReading:
        number = int(raw)
        if self._bits:
            width = 32 if register_types.is_wide(self._kind) else 16
            named = tuple(self._bits.get(bit, f"bit {bit}") for bit in range(width) if number >> bit & 1)
            return RegisterReading(raw, value, words=named)
        if number not in self._enum:
            return RegisterReading(raw, nan, f"unknown state {number}")
        return RegisterReading(raw, value, words=(self._enum[number],))


def _rejected(what: str, name: str, value: object, limit: str | None = None, cure: str = "") -> ConfigError:
    return ConfigError(what, where=f"register '{name}'", value=value, limit=limit, cure=cure)
