"""What a register says when it is read, and what others say of it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import NamedTuple


class RegisterReading(NamedTuple):
    """A register as read. `value` is NaN and `invalid` says why when the device has no value to give.

    A value that is not finite is none: whoever finds `invalid` None has a finite `value`, unless it is a text.
    `words` are the names of an enum's state or of the bits that are set, or the text of a string (whose value is NaN).
    """

    raw: int | float
    value: float
    invalid: str | None = None
    words: tuple[str, ...] = ()


class Context(NamedTuple):
    """What other registers say of one: sign of its magnitude, its scale, whether it is in °F, why it is invalid."""

    sign: int = 1
    scale: float | None = None
    fahrenheit: bool = False
    problem: str | None = None


ALONE = Context()


def problem_of(readings: Mapping[str, RegisterReading], names: Iterable[str]) -> str | None:
    """Why registers of these names have no value, each by its name; None when all have one."""
    invalid = [f"{name}: {readings[name].invalid}" for name in names if readings[name].invalid is not None]
    return "; ".join(invalid) or None
