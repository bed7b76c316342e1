"""Metrics of a run: its tracking error, and what the loop, the heater and the wire did."""

from __future__ import annotations

from dataclasses import dataclass
from math import nan

import numpy as np

from smadrive.control.loop import LATE_FRACTION, LoopMetrics
from smadrive.errors import DataError
from smadrive.runs.log.reader import Log
from smadrive.runs.metrics.series import energy_j, of_finite
from smadrive.runs.metrics.tracking_error import has_setpoint, tracking_percent
from smadrive.runs.run_metadata import rig_config_of


@dataclass(frozen=True)
class TrackingMetrics:
    """Metrics of a tracking run. The error is setpoint minus displacement after the approach, in % of the stroke.

    RMS and maximum are computed from the measured samples, without one that tripped: it may be invalid. They are NaN
    when the displacement was never measured, or its sensor was replaced for most of the run.
    """

    rms_percent: float
    max_percent: float
    ticks: int
    missed_deadlines: int
    trips: int
    log_file: str


def tracking_metrics(log: Log, loop: LoopMetrics) -> TrackingMetrics:
    """Return the metrics of a recorded tracking run. `loop` holds the counts of the control loop in this run.

    DataError when the log is of another kind of run.
    """
    rms, largest = tracking_percent(log)
    return TrackingMetrics(rms, largest, loop.ticks, loop.missed_deadlines, loop.trips, str(log.path))


def tripped_loop_metrics(log: Log) -> LoopMetrics:
    """Return the loop metrics of a run that ended with a trip, computed from its log.

    A log has rows only for ticks with a measurement, so lost exchanges and skipped deadlines are not counted.
    """
    return LoopMetrics(log.column("time_s").size, _missed_deadlines(log), trips=1)


@dataclass(frozen=True)
class RunMetrics:
    """Metrics of a complete or interrupted run, computed from its log alone. Unknown metrics are NaN.

    rms_percent, max_percent    RMS and largest tracking error, in % of the stroke, without a sample that tripped
    missed_deadlines            number of ticks that began late by more than `LATE_FRACTION` of a period
    late_max_s                  largest delay of a tick, s
    current_max_a               largest measured current, A
    energy_j                    electrical energy that the wire received, J
    limited_percent             share of ticks in which a limit reduced the output, %
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


def run_metrics(log: Log) -> RunMetrics:
    """Return the metrics of the run in `log`. DataError when the log has no row."""
    time_s = log.column("time_s")
    if time_s.size == 0:
        raise DataError("no tick was recorded", where=log.path, cure="record the run again")
    rms_percent, max_percent = tracking_percent(log) if has_setpoint(log) else (nan, nan)
    current_a, voltage_v = log.column_with_gaps("current_a"), log.column_with_gaps("voltage_v")
    return RunMetrics(
        log.kind.value,
        time_s.size,
        float(time_s[-1]),
        rms_percent,
        max_percent,
        _missed_deadlines(log),
        float(log.column("late_s").max()),
        of_finite(np.max, log.column_with_gaps("temperature_c")),
        of_finite(np.max, current_a),
        energy_j(time_s, current_a, voltage_v),
        100.0 * float(np.mean(log.column("limited"))),
    )


def is_virtual(log: Log) -> bool:
    """Return True if the run was in virtual time: no tick was late. In real time, ticks are always a little late."""
    return not log.column("late_s").any()


def _missed_deadlines(log: Log) -> int:
    return int(np.count_nonzero(log.column("late_s") > LATE_FRACTION / rig_config_of(log).rate_hz))
