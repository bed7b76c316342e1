"""The reading of a register, and the context of a reading, which other registers determine."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import NamedTuple


class RegisterReading(NamedTuple):
    """The reading of a register.

    raw        the raw number
    value      the value in engineering units; NaN if it is invalid, and for a text
    invalid    the reason why the value is invalid, else None
    words      the name of the enum's state, the names of the set bits, or the text of a string
    """

    raw: int | float
    value: float
    invalid: str | None = None
    words: tuple[str, ...] = ()


class Context(NamedTuple):
    """The properties of a value that other registers determine.

    sign          sign of the magnitude, 1 or -1
    scale         scale factor, or None for the scale in the profile
    fahrenheit    True if the value is in °F
    problem       reason why the value is invalid, else None
    """

    sign: int = 1
    scale: float | None = None
    fahrenheit: bool = False
    problem: str | None = None


ALONE = Context()


def problem_of(readings: Mapping[str, RegisterReading], names: Iterable[str]) -> str | None:
    """Return the reasons why these registers have no valid value, each with its name; return None if all are valid."""
    invalid = [f"{name}: {readings[name].invalid}" for name in names if readings[name].invalid is not None]
    return "; ".join(invalid) or None
