"""Numbers as text, with their unit or noun."""

from math import isfinite


def quantity(value: float, digits: int, unit: str) -> str:
    """Return a value with `digits` decimals and its unit; a dash for a value that is not finite."""
    return f"{value:.{digits}f} {unit}" if isfinite(value) else "–"


def count_text(number: int, noun: str) -> str:
    """Return a number with its noun, such as `1 sample` or `20 samples`."""
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"
