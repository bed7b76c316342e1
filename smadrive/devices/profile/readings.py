"""The reading of a register, and the context that other registers give it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import NamedTuple


class RegisterReading(NamedTuple):
    """The reading of a register. Without a valid value, `value` is NaN and `invalid` is the reason.

    Where `invalid` is None, `value` is finite, except for a text.
    `words` are the names of an enum's state or of the bits that are set, or the text of a string (whose value is NaN).
    """

    raw: int | float
    value: float
    invalid: str | None = None
    words: tuple[str, ...] = ()


class Context(NamedTuple):
    """Given by other registers: sign of the magnitude, scale, whether it is in °F, reason why it is invalid."""

    sign: int = 1
    scale: float | None = None
    fahrenheit: bool = False
    problem: str | None = None


ALONE = Context()


def problem_of(readings: Mapping[str, RegisterReading], names: Iterable[str]) -> str | None:
    """The reasons why registers of these names have no value, each by its name; None when all have one."""
    invalid = [f"{name}: {readings[name].invalid}" for name in names if readings[name].invalid is not None]
    return "; ".join(invalid) or None
