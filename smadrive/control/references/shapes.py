"""References described in one line by a shape: `sine:low_mm=2,high_mm=9,period_s=56,cycles=2`.

Each shape is a function of this file. Its keyword arguments are the keys of the line. Its positional argument
`longest_s` is not a key, but the longest duration in s: a longer reference is refused before its table is made.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from inspect import Parameter, signature
from math import isnan

import numpy as np

from smadrive.control.references.limits import (
    LONGEST_S,
    SHORTEST_S,
    TABLE_STEP_S,
    WHERE,
    check_displacement,
    check_length,
)
from smadrive.control.references.reference import Reference
from smadrive.errors import ConfigError, DataError
from smadrive.files.number_text import parse_number
from smadrive.files.spelling import suggestion, suggestion_or_list
from smadrive.numerics.arrays import FloatArray
from smadrive.numerics.scalars import real_number

ROUNDING = 1e-9
"""Allowed relative rounding error when a quotient of keys is compared with a bound or a whole number."""


_DECIMAL_COMMA = re.compile(r"(?<==)\s*[+-]?[0-9]+,[0-9]+(?![^,]*=)", re.ASCII)
"""A number with a decimal comma after `key=`."""


def parse_reference(spec: str, longest_s: float = LONGEST_S) -> Reference:
    """Return the reference that the line `spec` describes, such as `sine:low_mm=2,high_mm=9,period_s=56`.

    ConfigError for an unknown shape, for unknown, repeated or missing keys, and for an impossible value. The error
    lists the shapes or the keys. DataError (a ConfigError) for NaN, for a displacement that no wire has, and for a
    reference that is too short, too fast or longer than `longest_s`.
    """
    where = f"{WHERE} '{spec}'"
    shape, _, arguments = spec.partition(":")
    make = SHAPES.get(shape)
    if make is None:
        what, cure = f"'{shape}' is neither a shape nor a CSV file", suggestion_or_list(shape, SHAPES)
        raise ConfigError(what, where=where, cure=cure)
    _check_separators(arguments, where)
    given = [(key.strip(), value) for key, _, value in (part.partition("=") for part in arguments.split(",") if part)]
    keys = {name: key for name, key in signature(make).parameters.items() if key.kind is key.KEYWORD_ONLY}
    wrong = _wrong_keys([key for key, _ in given], keys)
    if wrong:
        key_list = ", ".join(_key_text(key) for key in keys.values())
        raise ConfigError(wrong, where=where, cure=f"use the keys of '{shape}': {key_list}")
    try:
        return make(longest_s, **{key: parse_number(value) for key, value in given})
    except ValueError as error:
        raise ConfigError(str(error), where=where) from None


def _check_separators(arguments: str, where: str) -> None:
    """Raise ConfigError for a semicolon, and for a number with a decimal comma."""
    if ";" in arguments:
        cure = (
            f"write '{arguments.replace(';', ',')}'"
            if "," not in arguments
            else "separate keys by commas, and use decimal points"
        )
        raise ConfigError("keys are separated by a semicolon instead of a comma", where=where, value="';'", cure=cure)
    if comma := _DECIMAL_COMMA.search(arguments):
        what, cure = "a decimal comma in a number", f"write {comma[0].replace(',', '.')}"
        raise ConfigError(what, where=where, value=comma[0], cure=cure)


def _wrong_keys(given: Sequence[str], keys: Mapping[str, Parameter]) -> str:
    """Describe the first unknown, repeated or missing key; the text is empty when the keys are right."""
    for key in given:
        if key not in keys:
            return f"unknown key '{key}'; {suggestion(key, keys)}".removesuffix("; ")
        if given.count(key) > 1:
            return f"key '{key}' is given more than once"
    missing = [name for name, key in keys.items() if key.default is key.empty and name not in given]
    return f"missing: {', '.join(missing)}" if missing else ""


def _key_text(key: Parameter) -> str:
    return f"{key.name}=" if key.default is key.empty else f"{key.name}= (optional: {key.default:g})"


def sine(
    longest_s: float = LONGEST_S, *, low_mm: float, high_mm: float, period_s: float, cycles: float = 2.0
) -> Reference:
    """Return a sine of period `period_s` between `low_mm` and `high_mm`, which begins at `low_mm`."""
    _check(low_mm=low_mm, high_mm=high_mm, period_s=period_s, cycles=cycles)
    _check_pace(period_s * cycles, 2 * cycles, longest_s)
    times = np.linspace(0.0, period_s * cycles, max(3, int(period_s * cycles / TABLE_STEP_S)))
    swing = 0.5 * (1.0 - np.cos(2.0 * np.pi * times / period_s))
    return Reference.from_samples(times, low_mm + (high_mm - low_mm) * swing)


def triangle(
    longest_s: float = LONGEST_S, *, low_mm: float, high_mm: float, period_s: float, cycles: float = 2.0
) -> Reference:
    """Return straight lines up and down between `low_mm` and `high_mm`. `cycles` may be a fraction."""
    _check(low_mm=low_mm, high_mm=high_mm, period_s=period_s, cycles=cycles)
    _check_pace(period_s * cycles, 2 * cycles, longest_s)
    legs = np.append(np.arange(np.ceil(2 * cycles)), 2 * cycles)
    height = 1.0 - np.abs(1.0 - legs % 2)
    return Reference.from_samples(legs * 0.5 * period_s, low_mm + (high_mm - low_mm) * height)


def staircase(
    longest_s: float = LONGEST_S,
    *,
    low_mm: float,
    high_mm: float,
    steps: float = 4.0,
    dwell_s: float = 10.0,
    rise_s: float = 2.0,
) -> Reference:
    """Return a reference with `steps` equal steps up from `low_mm` to `high_mm`, then as many down.

    Each level is held for `dwell_s`. Each rise or fall takes `rise_s`.
    """
    _check(low_mm=low_mm, high_mm=high_mm, steps=steps, dwell_s=dwell_s, rise_s=rise_s)
    _check_pace(2 * steps * (dwell_s + rise_s) + dwell_s, 2 * steps, longest_s)
    up = np.linspace(low_mm, high_mm, _multiple("steps", steps, of=1.0) + 1)
    return _held(np.concatenate((up, up[-2::-1])), dwell_s, every_s=dwell_s + rise_s)


def steps(
    longest_s: float = LONGEST_S, *, low_mm: float, high_mm: float, dwell_s: float = 10.0, cycles: float = 2.0
) -> Reference:
    """Return a reference that jumps between `low_mm` and `high_mm`, and holds each level for `dwell_s`.

    No wire follows a jump. With `smooth=True` or `smadrive run --smooth`, the run tracks the nearest reference that the
    wire can follow.
    """
    _check(low_mm=low_mm, high_mm=high_mm, dwell_s=dwell_s, cycles=cycles)
    _check_pace((2 * cycles + 1) * dwell_s, 2 * cycles, longest_s)
    return _held(_alternating(low_mm, high_mm, cycles), dwell_s - TABLE_STEP_S, every_s=dwell_s)


def trapezoid(
    longest_s: float = LONGEST_S,
    *,
    low_mm: float,
    high_mm: float,
    rise_s: float = 10.0,
    dwell_s: float = 5.0,
    cycles: float = 2.0,
) -> Reference:
    """Return straight lines between `low_mm` and `high_mm`.

    Each line takes `rise_s`. Each level is held for `dwell_s`. With equal levels, the reference holds this level.
    """
    _check(may_hold=True, low_mm=low_mm, high_mm=high_mm, rise_s=rise_s, dwell_s=dwell_s, cycles=cycles)
    _check_pace(2 * cycles * (dwell_s + rise_s) + dwell_s, 2 * cycles, longest_s)
    return _held(_alternating(low_mm, high_mm, cycles), dwell_s, every_s=dwell_s + rise_s)


def chirp(
    longest_s: float = LONGEST_S,
    *,
    low_mm: float,
    high_mm: float,
    start_hz: float,
    end_hz: float,
    duration_s: float = 120.0,
) -> Reference:
    """Return a swing between `low_mm` and `high_mm` that lasts `duration_s`.

    Its frequency changes linearly from `start_hz` to `end_hz`.
    """
    _check(low_mm=low_mm, high_mm=high_mm, start_hz=start_hz, end_hz=end_hz, duration_s=duration_s)
    _check_pace(duration_s, 2 * max(start_hz, end_hz) * duration_s, longest_s)
    rate_hz_per_s = (end_hz - start_hz) / duration_s
    times = np.linspace(0.0, duration_s, max(3, int(duration_s / TABLE_STEP_S)))
    turns = (start_hz + 0.5 * rate_hz_per_s * times) * times
    return Reference.from_samples(times, low_mm + (high_mm - low_mm) * 0.5 * (1.0 - np.cos(2.0 * np.pi * turns)))


def _alternating(low_mm: float, high_mm: float, cycles: float) -> FloatArray:
    """Return the levels low, high, low, ... for `cycles` cycles; a cycle goes up and down."""
    return np.where(np.arange(_multiple("cycles", cycles, of=0.5) + 1) % 2 == 0, low_mm, high_mm)


def _held(levels_mm: FloatArray, hold_s: float, *, every_s: float) -> Reference:
    """Return a reference with a new level every `every_s`, held for `hold_s`, and straight lines between the levels."""
    starts = np.arange(levels_mm.size) * every_s
    times = np.column_stack((starts, starts + hold_s)).ravel()
    return Reference.from_samples(times, np.repeat(levels_mm, 2))


def _check(*, may_hold: bool = False, **keys: float) -> None:
    """Raise DataError for NaN and for a displacement that no wire has.

    ConfigError for a value of another type, for a value of 0 or below except a displacement, and for equal levels
    unless `may_hold` is True.
    """
    for name, given in keys.items():
        value = real_number(given, f"{WHERE}: {name}")
        if isnan(value):
            cure = "write a number such as 2 or 0.1"
            raise DataError("not a number", where=f"{WHERE}: {name}", value=value, cure=cure)
        if name.endswith("_mm"):
            check_displacement(name, value)
        elif not value > 0:
            raise ConfigError("not positive", where=f"{WHERE}: {name}", value=value, cure="write a number above 0")
    if keys["low_mm"] == keys["high_mm"] and not may_hold:
        level = f"{keys['low_mm']:g}"
        cure = f"choose two levels, or hold one: 'trapezoid:low_mm={level},high_mm={level}'"
        raise ConfigError("the levels are equal", where=f"{WHERE}: high_mm", value=f"{level} mm", cure=cure)


def _multiple(name: str, value: float, *, of: float) -> int:
    """Return value / of. ConfigError if it is not a whole number, because each level is held for its whole dwell."""
    count = round(value / of)
    if abs(value / of - count) > ROUNDING * count:
        near = " or ".join(f"{of * whole:g}" for whole in (int(value / of), int(value / of) + 1) if whole)
        raise ConfigError(f"not a multiple of {of:g}", where=f"{WHERE}: {name}", value=value, cure=f"choose {near}")
    return count


def _check_pace(duration_s: float, pieces: float, longest_s: float) -> None:
    """Raise DataError when a shape is too short or too long, or one of its `pieces` is shorter than `SHORTEST_S`.

    A piece is half a swing, or a level. With shorter pieces, the table would have too few samples per swing and show a
    slower swing (alias). A piece of `SHORTEST_S` still has five steps. Call this function before the table is made.
    """
    check_length(duration_s, longest_s=real_number(longest_s, f"{WHERE}: longest_s"))
    most = duration_s / SHORTEST_S
    if pieces > most * (1.0 + ROUNDING):
        raise DataError(
            "the half swings or levels are too short",
            where=WHERE,
            value=f"{pieces:g} in {duration_s:g} s",
            limit=f"{most:g} of {SHORTEST_S:g} s each",
            cure="lower the number of swings or levels, or slow the reference down. Are its times in seconds?",
        )


SHAPES: dict[str, Callable[..., Reference]] = {
    make.__name__: make for make in (sine, triangle, trapezoid, steps, staircase, chirp)
}
