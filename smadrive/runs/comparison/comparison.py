"""Runs side by side: names, metrics with their differences from the first run, and the settings that differ."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields
from functools import cached_property
from math import isfinite, nan
from typing import NamedTuple

import numpy as np

from smadrive.errors import DataError
from smadrive.runs.comparison.settings import differing_settings
from smadrive.runs.log.reader import Log
from smadrive.runs.metrics.run import RunMetrics, run_metrics
from smadrive.runs.metrics.series import of_finite
from smadrive.runs.metrics.tracking_error import measured_mm

MOST_RUNS = 8
"""Largest number of runs in a comparison: plots have this number of colours."""

NAME_LENGTH = 28
"""Largest number of characters of a run's name. A longer name is cut at its beginning."""


class Quantity(NamedTuple):
    """A row of the table of metrics: its name, the attribute of `ComparedMetrics`, its unit and its decimal places.

    `factor` converts the attribute to `unit`.
    """

    name: str
    attribute: str
    unit: str
    digits: int
    factor: float = 1.0


QUANTITIES = (
    Quantity("RMS error", "rms_percent", "%", 2),
    Quantity("largest error", "max_percent", "%", 2),
    Quantity("displacement span, with approach", "span_mm", "mm", 3),
    Quantity("highest temperature", "temperature_max_c", "°C", 1),
    Quantity("largest current", "current_max_a", "A", 3),
    Quantity("electrical energy", "energy_j", "J", 1),
    Quantity("at a limit", "limited_percent", "% of the time", 1),
    Quantity("length", "duration_s", "s", 1),
    Quantity("missed deadlines", "missed_deadlines", "", 0),
    Quantity("largest delay", "late_max_s", "ms", 1, 1e3),
)


@dataclass(frozen=True)
class ComparedMetrics(RunMetrics):
    """The metrics of a run, and the span of its displacement.

    `span_mm` is the highest minus the lowest displacement of the whole run, including its approach. The readings of a
    sensor that was replaced do not count. It is NaN if no displacement was measured.
    """

    span_mm: float = nan


@dataclass(frozen=True)
class RunComparison:
    """The logs of two or more runs. The other runs are compared with the first run."""

    logs: tuple[Log, ...]

    def __post_init__(self) -> None:
        """Raise DataError for too few or too many runs, or for a log that is given twice."""
        count, where = len(self.logs), "comparison"
        if not 2 <= count <= MOST_RUNS:
            cure = "give a number of logs within the limit"
            what, limit = "too few or too many runs to compare", f"2 to {MOST_RUNS}"
            raise DataError(what, where=where, value=count, limit=limit, cure=cure)
        for number, log in enumerate(self.logs):
            if any(log.path.samefile(other.path) for other in self.logs[:number]):
                raise DataError("is given twice", where=log.path, cure="give each log once")

    @cached_property
    def names(self) -> tuple[str, ...]:
        """The name of each run: the name of its file, or the path if two files have the same name."""
        stems = [log.path.stem for log in self.logs]
        names = [stem if stems.count(stem) == 1 else str(log.path) for stem, log in zip(stems, self.logs, strict=True)]
        return tuple(name if len(name) <= NAME_LENGTH else f"…{name[1 - NAME_LENGTH :]}" for name in names)

    @cached_property
    def metrics(self) -> tuple[ComparedMetrics, ...]:
        """The metrics of each run. DataError when a log has no row."""
        return tuple(ComparedMetrics(**asdict(run_metrics(log)), span_mm=_span_mm(log)) for log in self.logs)

    @cached_property
    def settings(self) -> dict[str, tuple[str, ...]]:
        """The settings in which the runs differ: name of the setting to its value in each run, as text."""
        return differing_settings(self.logs)

    def differences(self) -> list[dict[str, float]]:
        """Return one dict for each run: name of a metric to its value minus its value in the first run."""
        names = [field.name for field in fields(ComparedMetrics) if field.name != "kind"]
        first = self.metrics[0]
        return [{name: getattr(run, name) - getattr(first, name) for name in names} for run in self.metrics]

    def metric_rows(self) -> list[tuple[str, ...]]:
        """Return the rows of the table of metrics: name, then each run's value and its difference from the first run.

        A metric that is unknown in every run is left out.
        """
        rows = []
        for quantity in QUANTITIES:
            values = [quantity.factor * getattr(run, quantity.attribute) for run in self.metrics]
            if any(map(isfinite, values)):
                rows.append((_title(quantity), *_cells(values, quantity.digits)))
        return rows


def _title(quantity: Quantity) -> str:
    return f"{quantity.name} / {quantity.unit}" if quantity.unit else quantity.name


def _cells(values: Sequence[float], digits: int) -> list[str]:
    first, *others = values
    cells = [_text(first, digits)]
    for value in others:
        difference = value - first
        shown = f"{difference:+.{digits}f}"
        is_other = isfinite(difference) and float(shown) != 0.0
        cells.append(f"{_text(value, digits)} ({shown})" if is_other else _text(value, digits))
    return cells


def _text(value: float, digits: int) -> str:
    return f"{value:.{digits}f}" if isfinite(value) else "–"


def _span_mm(log: Log) -> float:
    return of_finite(np.ptp, measured_mm(log))
