"""Checks of single numbers that a script passes as arguments. A text is not a number, even if it consists of digits."""

from __future__ import annotations

from numbers import Integral, Real

import numpy as np

from smadrive.errors import ConfigError, SmadriveError


def real_number(value: object, where: str, error: type[SmadriveError] = ConfigError) -> float:
    """Return `value` as a float, which may be NaN or infinite.

    `error` is the class of the error that is raised for a value of another type, and for a number that is too large for
    a float. `where` names the value in this error.
    """
    if not _is_real(value):
        cure = "pass a number, without quotes" if isinstance(value, str) else "pass a number"
        raise error("of the wrong type", where=where, value=type(value).__qualname__, cure=cure)
    try:
        return float(value)  # type: ignore[arg-type]
    except OverflowError:
        raise error("too large for a floating-point number", where=where, cure="pass a smaller number") from None


def whole_number(
    value: object, where: str, what: str, least: int, most: int | None = None, error: type[SmadriveError] = ConfigError
) -> int:
    """Return `value` as an int. Raises `error` if it is not a whole number from `least` to `most`.

    `where` names the value in the error, and `what` completes its message "not a number of ...".
    """
    number = None if isinstance(value, bool) or not isinstance(value, Integral) else int(value)
    if number is None or number < least or (most is not None and number > most):
        limit = f"at least {least}" if most is None else f"{least} to {most}"
        cure = "pass a whole number within this limit"
        raise error(f"not a number of {what}", where=where, value=_shown(value), limit=limit, cure=cure)
    return number


def _is_real(value: object) -> bool:
    """Return True for a number, and for a number in a numpy array without dimensions."""
    if isinstance(value, np.ndarray):
        return value.ndim == 0 and value.dtype.kind in "iuf"
    return isinstance(value, Real) and not isinstance(value, bool)


def _shown(value: object) -> int | str:
    """Return a whole number as it is, and any other value as a short text."""
    try:
        return value if type(value) is int and str(value) else repr(value)[:60]
    except ValueError:  # a whole number of thousands of digits
        return type(value).__qualname__
