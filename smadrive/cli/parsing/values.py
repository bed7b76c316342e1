"""Checks of the values of options and arguments. A mistyped value raises a ConfigError that says what to write.

typer's own messages name the type of a value, but not what the user must write instead.
"""

from __future__ import annotations

from collections.abc import Callable
from enum import Enum
from math import isfinite, isnan
from typing import Any

import typer

from smadrive.errors import ConfigError
from smadrive.files.number_text import parse_number, with_decimal_point
from smadrive.files.spelling import suggestion_or_list


def checked_conversion(param: Any) -> Callable[[Any, Any], Any]:
    """Return a function that converts a value as typer does for `param`, but raises ConfigError for a mistyped value.

    While a shell completes a line, errors stay those of typer.
    """
    convert = param.process_value

    def process_value(context: Any, value: Any) -> Any:
        try:
            found = convert(context, value)
        except typer.BadParameter:
            if not context.resilient_parsing and isinstance(value, str):
                check_text(_place(param), value, _annotation(param), _range(param))
            raise
        if isinstance(found, float) and not context.resilient_parsing:
            check_finite(_place(param), found)
        return found

    return process_value


def check_text(
    where: str, text: str, annotation: object, limits: tuple[float | None, float | None] = (None, None)
) -> None:
    """Raise ConfigError for `text`, which typer has rejected as a value of the type `annotation`.

    For an enumeration, the cure names the possible values. For a number, the error says whether the text is no number
    or is outside `limits`, the smallest and the largest value (None: no limit). Other types raise nothing.
    """
    if isinstance(annotation, type) and issubclass(annotation, Enum):
        names = [str(member.value) for member in annotation]
        raise ConfigError("unknown", where=where, value=text, cure=suggestion_or_list(text, names))
    if annotation in {int, float}:
        number = check_number(where, text)
        if annotation is int and number % 1.0:
            raise ConfigError("not a whole number", where=where, value=text, cure="write a number such as 2")
        _check_range(where, number, *limits)


def _check_range(where: str, number: float, least: float | None, most: float | None) -> None:
    if (least is None or number >= least) and (most is None or number <= most):
        return
    limit = (
        f"at least {least:g}" if most is None else f"at most {most:g}" if least is None else f"{least:g} to {most:g}"
    )
    raise ConfigError(
        "out of range", where=where, value=f"{number:g}", limit=limit, cure="write a number in this range"
    )


def check_number(where: str, text: str) -> float:
    """Return the finite number in `text`. ConfigError for any other text."""
    corrected = with_decimal_point(text)
    if corrected is not None:
        raise ConfigError("a number has a decimal comma", where=where, value=text, cure=f"write {corrected}")
    try:
        number = parse_number(text)
    except ValueError:
        cure = "write a number without a unit, such as 2 or 0.1"
        raise ConfigError("not a number", where=where, value=text[:60], cure=cure) from None
    return check_finite(where, number)


def check_finite(where: str, number: float) -> float:
    """Return the number. ConfigError when it is NaN or infinite."""
    if not isfinite(number):
        what = "not a number" if isnan(number) else "not a finite number"
        raise ConfigError(what, where=where, value=f"{number:g}", cure="write a number such as 2 or 0.1")
    return number


def _place(param: Any) -> str:
    """Return the name of an option with its dashes, or the name of an argument in capital letters."""
    return str(param.name).upper() if param.param_type_name == "argument" else str(max(param.opts, key=len))


def _annotation(param: Any) -> object:
    """Return the type of the values of `param`, or None if typer does not know it."""
    return getattr(getattr(param, "type_descriptor", None), "annotation", None)


def _range(param: Any) -> tuple[float | None, float | None]:
    """Return the smallest and the largest value of `param`; None where it has no limit."""
    info = getattr(getattr(param, "type_descriptor", None), "parameter_info", None)
    return getattr(info, "min", None), getattr(info, "max", None)
