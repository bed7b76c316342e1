"""A line plot as inline SVG: a few kilobytes, no library, sharp at every size."""

from __future__ import annotations

import html
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import ceil, floor, isfinite, log10

WIDTH, HEIGHT = 420, 210
LEFT, RIGHT, TOP, BOTTOM = 48, 10, 22, 36
"""Margins around the axes, in pixels."""

POINTS = 300
"""A curve is drawn with at most about this many points."""

TICKS = 5
INK = "currentColor"
"""The colour of the page's text."""


@dataclass(frozen=True)
class Curve:
    """One line of a plot. The line has a gap where x or y is not finite."""

    x: Sequence[float]
    y: Sequence[float]
    label: str
    colour: str
    is_dashed: bool = False


@dataclass(frozen=True)
class _Axis:
    """Maps values between `low` and `high` to pixels between `first` and `last`."""

    low: float
    high: float
    first: float
    last: float

    def at(self, value: float) -> float:
        return self.first + (value - self.low) / (self.high - self.low) * (self.last - self.first)

    def ticks(self) -> list[float]:
        """Return round values within the axis, about `TICKS` of them."""
        raw = (self.high - self.low) / TICKS
        magnitude = 10.0 ** floor(log10(raw))
        step = next(m * magnitude for m in (1, 2, 5, 10) if m * magnitude >= raw)
        first, last = ceil(self.low / step), floor(self.high / step)
        return [number * step for number in range(first, last + 1)]


def line_plot(curves: Sequence[Curve], x_label: str, y_label: str) -> str:
    """Return the SVG text of the curves; an empty text when no point is finite."""
    shown = [_thinned(curve) for curve in curves]
    points = [point for curve in shown for point in curve if _is_finite(point)]
    if not points:
        return ""
    x_axis = _axis([x for x, _ in points], LEFT, WIDTH - RIGHT, slack=0.0)
    y_axis = _axis([y for _, y in points], HEIGHT - BOTTOM, TOP, slack=0.05)
    parts = [*_grid(x_axis, y_axis), *_labels(x_label, y_label), *_legend(curves)]
    for curve, path in zip(curves, shown, strict=True):
        drawn = _path(path, x_axis, y_axis)
        parts.append(f"<path d='{drawn}' stroke='{curve.colour}' fill='none'{_dashes(curve)}/>")
    size = f"width='{WIDTH}' height='{HEIGHT}' viewBox='0 0 {WIDTH} {HEIGHT}'"
    font = "font-family='system-ui,sans-serif' font-size='11' stroke-width='1.4'"
    return f"<svg xmlns='http://www.w3.org/2000/svg' {size} {font}>{''.join(parts)}</svg>"


def _thinned(curve: Curve) -> list[tuple[float, float]]:
    """Return the points to draw: all of them, or at most about `POINTS`.

    Of a longer curve these are the lowest and the highest point in each of `POINTS`/2 intervals, and the last point.
    """
    points = [(float(x), float(y)) for x, y in zip(curve.x, curve.y, strict=True)]
    if len(points) <= POINTS:
        return points
    size = ceil(2 * len(points) / POINTS)
    kept = []
    for begin in range(0, len(points), size):
        block = sorted(range(begin, min(begin + size, len(points))), key=lambda n: _height(points[n]))
        kept += sorted({block[0], block[-1]})
    return [points[n] for n in kept] + points[-1:]


def _height(point: tuple[float, float]) -> float:
    """Return the sort key of a point. A gap counts as the least point of its interval, so that it is kept."""
    return point[1] if _is_finite(point) else float("-inf")


def _is_finite(point: tuple[float, float]) -> bool:
    return isfinite(point[0]) and isfinite(point[1])


def _axis(values: Sequence[float], first: float, last: float, slack: float) -> _Axis:
    low, high = min(values), max(values)
    margin = slack * (high - low) or (0.0 if high > low else 0.5 * abs(high) or 0.5)
    return _Axis(low - margin, high + margin, first, last)


def _path(points: Sequence[tuple[float, float]], x_axis: _Axis, y_axis: _Axis) -> str:
    parts, is_drawing = [], False
    for point in points:
        if _is_finite(point):
            place = f"{x_axis.at(point[0]):.1f} {y_axis.at(point[1]):.1f}"
            parts.append(f"{'L' if is_drawing else 'M'}{place}")
        is_drawing = _is_finite(point)
    return "".join(parts)


def _dashes(curve: Curve) -> str:
    return " stroke-dasharray='4 3'" if curve.is_dashed else ""


def _grid(x_axis: _Axis, y_axis: _Axis) -> Iterator[str]:
    for value in y_axis.ticks():
        y = y_axis.at(value)
        yield f"<path d='M{LEFT} {y:.1f}H{WIDTH - RIGHT}' stroke='{INK}' stroke-opacity='.15'/>"
        yield f"<text x='{LEFT - 5}' y='{y + 4:.1f}' text-anchor='end' fill='{INK}'>{value + 0.0:.6g}</text>"
    for value in x_axis.ticks():
        x = x_axis.at(value)
        yield f"<path d='M{x:.1f} {TOP}V{HEIGHT - BOTTOM}' stroke='{INK}' stroke-opacity='.15'/>"
        place = f"x='{x:.1f}' y='{HEIGHT - BOTTOM + 14}'"
        yield f"<text {place} text-anchor='middle' fill='{INK}'>{value + 0.0:.6g}</text>"


def _labels(x_label: str, y_label: str) -> Iterator[str]:
    middle, height = (LEFT + WIDTH - RIGHT) / 2, (TOP + HEIGHT - BOTTOM) / 2
    yield f"<text x='{middle}' y='{HEIGHT - 6}' text-anchor='middle' fill='{INK}'>{html.escape(x_label)}</text>"
    place = f"transform='translate(12 {height}) rotate(-90)'"
    yield f"<text {place} text-anchor='middle' fill='{INK}'>{html.escape(y_label)}</text>"


def _legend(curves: Sequence[Curve]) -> Iterator[str]:
    """Yield the SVG of the curves' labels, in a row above the axes."""
    x = LEFT
    for curve in curves:
        yield f"<path d='M{x} 10h16' stroke='{curve.colour}'{_dashes(curve)}/>"
        yield f"<text x='{x + 20}' y='14' fill='{INK}'>{html.escape(curve.label)}</text>"
        x += 34 + 7 * len(curve.label)
