"""The table of a run that repeats its reference: one row for each cycle."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from smadrive.runs.cycling.cycles import CycleMetrics

_TABLE_COLUMNS = (
    ("stroke / mm", "stroke_mm", 3),
    ("RMS error / %", "rms_percent", 2),
    ("largest / %", "max_percent", 2),
    ("at rest / Ω", "rest_ohm", 3),
    ("energy / J", "energy_j", 1),
    ("highest / °C", "temperature_max_c", 1),
)  # title, metric, decimal places

CYCLE_HEADER = ("cycle", *(title for title, *_ in _TABLE_COLUMNS))
"""The titles of the columns."""


def cycle_rows(cycles: Iterable[CycleMetrics]) -> list[tuple[str, ...]]:
    """Return one row of texts for each cycle, with the columns of `CYCLE_HEADER`."""
    return [
        (str(one.cycle), *(_cell(getattr(one, metric), digits) for _, metric, digits in _TABLE_COLUMNS))
        for one in cycles
    ]


def thinned(cycles: list[CycleMetrics], most: int) -> list[CycleMetrics]:
    """Return at most `most` of the cycles, evenly spaced, with the first and the last one."""
    if len(cycles) <= most:
        return cycles
    return [cycles[n] for n in np.unique(np.linspace(0, len(cycles) - 1, most).round().astype(int))]


def _cell(value: float, digits: int) -> str:
    return f"{value:.{digits}f}" if np.isfinite(value) else "–"
