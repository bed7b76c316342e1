"""How a recorded run went: the tracking error, and what the loop, the heater and the wire did."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from math import nan
from typing import Any

import numpy as np
from numpy.typing import NDArray

from smadrive.control.loop import LATE_FRACTION, LoopMetrics
from smadrive.errors import DataError
from smadrive.runs.log.reader import Log
from smadrive.runs.run_metadata import logged_reference, logged_rig, logged_wire
from smadrive.wire.wire_model import travel_mm

Array = NDArray[np.float64]

FEW_MISSING = 0.03
"""A sensor loses a sample now and then; a larger share of them lets doubt the figures."""


def error_percent(log: Log) -> Array:
    """Reference - displacement of every row, in % of the stroke; NaN during the approach and where nothing is measured.

    DataError when the log is of no tracking run.
    """
    cold_mm, hot_mm = travel_mm(logged_wire(log).model)
    error = 100.0 * (log.signal("reference_mm") - log.signal("displacement_mm")) / abs(hot_mm - cold_mm)
    return np.where(log.column("time_s") >= logged_reference(log).scored_from_s, error, nan)


def is_virtual(log: Log) -> bool:
    """Whether the run was in virtual time: in real time every tick begins a little after its deadline."""
    return not log.column("late_s").any()


@dataclass(frozen=True)
class TrackingMetrics:
    """How a run went: error = reference - displacement in % of the stroke, after the approach, where it was measured.

    NaN where nothing measured the displacement.
    """

    rms_percent: float
    max_percent: float
    ticks: int
    missed_deadlines: int
    trips: int
    log_file: str


def tracking_metrics(log: Log, loop: LoopMetrics) -> TrackingMetrics:
    """The figures of a recorded tracking run, whose loop counted `loop`. DataError when the log is of none."""
    rms, largest = _rms_and_max(error_percent(log))
    return TrackingMetrics(rms, largest, loop.ticks, loop.missed_deadlines, loop.trips, str(log.path))


def tripped_loop(log: Log) -> LoopMetrics:
    """What the loop of a run that a trip cut had counted before it; of lost exchanges the log does not tell."""
    return LoopMetrics(log.column("time_s").size, _missed_deadlines(log), trips=1)


def tracking_caveats(log: Log) -> tuple[str, ...]:
    """What lets doubt what the figures of a tracking run tell of it. DataError when the log is of none.

    First what was known before the run, a reference that was smoothed for instance; then what its samples tell.
    """
    told_before = log.parsed("caveats", _texts) if "caveats" in log.about else ()
    return (*told_before, *_doubtful_samples(log))


def _texts(values: Iterable[Any]) -> tuple[str, ...]:
    return tuple(map(str, values))


def _doubtful_samples(log: Log) -> tuple[str, ...]:
    error = error_percent(log)[log.column("time_s") >= logged_reference(log).scored_from_s]
    if error.size == 0:
        return ("the tracking error is unknown: the run ended in its approach, which is not scored",)
    missing = int(np.count_nonzero(np.isnan(error)))
    if missing == error.size:
        return ("the tracking error is unknown: no displacement was measured (no displacement sensor that works)",)
    if missing <= FEW_MISSING * error.size:
        return ()
    percent = 100.0 * missing / error.size
    lost = f"{missing} of {error.size} samples of the displacement are missing ({percent:.0f} %)"
    return (f"{lost}: the error is that of the others",)


@dataclass(frozen=True)
class RunMetrics:
    """What a log alone tells of its run, complete or cut; NaN where it is not known.

    `energy_j` is what the heater gave; `limited_percent` the share of the ticks in which something held it back.
    """

    kind: str
    ticks: int
    duration_s: float
    rms_percent: float
    max_percent: float
    missed_deadlines: int
    late_max_s: float
    temperature_max_c: float
    current_max_a: float
    energy_j: float
    limited_percent: float


def run_summary(log: Log) -> RunMetrics:
    """The summary of `log`. DataError when nothing was recorded."""
    time_s = log.column("time_s")
    if time_s.size == 0:
        raise DataError(f"{log.path}: no tick was recorded: there is nothing to report")
    tracked = "reference" in log.about
    error = error_percent(log) if tracked else np.array([nan])
    power_w = log.signal("current_a") * log.signal("voltage_v")
    return RunMetrics(
        log.text("kind"),
        time_s.size,
        float(time_s[-1]),
        *_rms_and_max(error),
        _missed_deadlines(log),
        float(log.column("late_s").max()),
        _largest(log.signal("temperature_c")),
        _largest(log.signal("current_a")),
        float(np.nansum(power_w[1:] * np.diff(time_s))),
        100.0 * float(np.mean(log.column("limited"))),
    )


def _missed_deadlines(log: Log) -> int:
    return int(np.count_nonzero(log.column("late_s") > LATE_FRACTION / logged_rig(log).rate_hz))


def _rms_and_max(values: Array) -> tuple[float, float]:
    """Of the values that are known; NaN when none is."""
    known = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(known**2))) if known.size else nan, _largest(np.abs(known))


def _largest(values: Array) -> float:
    known = values[np.isfinite(values)]
    return float(known.max()) if known.size else nan
