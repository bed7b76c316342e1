"""Metrics of a recorded run: its tracking error, and what the loop, the heater and the wire did."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from math import nan
from typing import Any

import numpy as np
from numpy.typing import NDArray

from smadrive.control.loop import LATE_FRACTION, LoopMetrics
from smadrive.errors import DataError
from smadrive.identification.quality.thermocouple_noise import noise_caveats
from smadrive.runs.log.reader import Log
from smadrive.runs.run_metadata import nominal_balance, reference_of, rig_config_of, step_of, texts_of, wire_of
from smadrive.wire.data_sheet import resistance_caveats
from smadrive.wire.wire_model import travel_mm

Array = NDArray[np.float64]

END_S = 1.0
"""The value at the end of a manual step is the median over this last part of the step, in seconds."""

MEASURABLE = 0.05
"""A resistance is computed only at currents of at least this share of current_max_a, where offsets matter little."""

NOT_REACHED_K = 2.0
"""A step has not reached its setpoint if it ends more than this from the setpoint, in K."""

FEW_MISSING = 0.03
"""Largest share of samples that a working sensor misses. A larger share gives a warning about the metrics."""


def has_setpoint(log: Log) -> bool:
    """Return True for a tracking run, and for a run of the user's controller that returned displacement setpoints."""
    is_own = "controller" in log.metadata and bool(np.isfinite(log.column_with_gaps("setpoint_mm")).any())
    return "reference" in log.metadata or is_own


def scored_from_s(log: Log) -> float:
    """Return the time in s at which the metrics begin: the end of the approach, or 0 for a run without an approach."""
    return reference_of(log).scored_from_s if "reference" in log.metadata else 0.0


def error_percent(log: Log) -> Array:
    """Return setpoint minus displacement of every row, in % of the stroke.

    The error is NaN during the approach, and where no displacement was measured. DataError when the log is not of a
    run on an identified wire.
    """
    cold_mm, hot_mm = travel_mm(wire_of(log).model)
    error_mm = log.column_with_gaps("setpoint_mm") - log.column_with_gaps("displacement_mm")
    is_scored = log.column("time_s") >= scored_from_s(log)
    return np.where(is_scored, 100.0 * error_mm / abs(hot_mm - cold_mm), nan)


def is_virtual(log: Log) -> bool:
    """Return True if the run was in virtual time: no tick was late. In real time, ticks are always a little late."""
    return not log.column("late_s").any()


@dataclass(frozen=True)
class TrackingMetrics:
    """Metrics of a tracking run. The error is setpoint minus displacement after the approach, in % of the stroke.

    RMS and maximum are computed from the measured samples. They are NaN when the displacement was never measured.
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
    rms, largest = _rms_and_max(error_percent(log))
    return TrackingMetrics(rms, largest, loop.ticks, loop.missed_deadlines, loop.trips, str(log.path))


def tripped_loop_metrics(log: Log) -> LoopMetrics:
    """Return the loop metrics of a run that ended with a trip, computed from its log.

    A log has rows only for ticks with a measurement, so lost exchanges and skipped deadlines are not counted.
    """
    return LoopMetrics(log.column("time_s").size, _missed_deadlines(log), trips=1)


def tracking_caveats(log: Log) -> tuple[str, ...]:
    """Return reasons to distrust the metrics of a tracking run. DataError when the log is of another kind of run.

    The first reasons were known before the run, for example that the reference was smoothed.
    """
    return (*texts_of(log, "caveats"), *_sample_caveats(log), *_noise_caveats(log))


def run_caveats(log: Log) -> tuple[str, ...]:
    """Return reasons to distrust the content of a log, or the metrics of its run. The run may be of any kind."""
    metrics = tracking_caveats(log) if has_setpoint(log) else (*texts_of(log, "caveats"), *_noise_caveats(log))
    return (*log.caveats, *metrics, *(_command_caveats(log) if "controller" in log.metadata else ()))


def _noise_caveats(log: Log) -> tuple[str, ...]:
    if "rig" not in log.metadata:
        return ()
    return noise_caveats(log.column_with_gaps("temperature_c"), rig_config_of(log).feedback.noise_c)


def _sample_caveats(log: Log) -> tuple[str, ...]:
    error = error_percent(log)[log.column("time_s") >= scored_from_s(log)]
    if error.size == 0:
        return ("the tracking error is unknown: the run ended in its approach, which is not scored",)
    missing = int(np.count_nonzero(np.isnan(error)))
    if missing == error.size:
        return ("the tracking error is unknown: no displacement was measured (no working displacement sensor)",)
    if missing <= FEW_MISSING * error.size:
        return ()
    share = f"{missing} of {error.size} samples of the displacement are missing ({100.0 * missing / error.size:.0f} %)"
    return (f"{share}: the tracking error is computed from the other samples",)


def _command_caveats(log: Log) -> Iterator[str]:
    """Yield caveats about the commands of the user's controller: currents and setpoints outside their ranges."""
    current_max_a = rig_config_of(log).limits.current_max_a
    commanded_a = log.column_with_gaps("commanded_a")
    if above := int(np.count_nonzero(commanded_a > current_max_a)):
        limit = f"current_max_a = {current_max_a:g} A (largest {np.nanmax(commanded_a):.3g} A)"
        yield f"{above} of {commanded_a.size} commands were above {limit} and were clamped"
    if negative := int(np.count_nonzero(commanded_a < 0.0)):
        lowest = f"lowest {np.nanmin(commanded_a):.3g} A"
        yield f"{negative} of {commanded_a.size} commands were negative ({lowest}), and zero was sent"
    setpoint_mm, reach_mm = log.column_with_gaps("setpoint_mm"), sorted(travel_mm(wire_of(log).model))
    if outside := int(np.count_nonzero((setpoint_mm < reach_mm[0]) | (setpoint_mm > reach_mm[1]))):
        reach = f"{reach_mm[0]:.2f} to {reach_mm[1]:.2f} mm"
        yield f"{outside} of {setpoint_mm.size} setpoints were outside the reach of the wire, {reach}"


@dataclass(frozen=True)
class RunMetrics:
    """Metrics of a complete or interrupted run, computed from its log alone. Unknown metrics are NaN.

    rms_percent, max_percent    RMS and largest tracking error, in % of the stroke
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


@dataclass(frozen=True)
class StepMetrics:
    """The wire at the end of a manual step, and over the whole step. Unknown values are NaN.

    The values at the end are medians over the last second, or the last sample if the step ended early. The
    resistance includes leads and clamps.
    """

    temperature_end_c: float
    temperature_max_c: float
    displacement_end_mm: float
    current_end_a: float
    resistance_end_ohm: float
    energy_j: float


def step_metrics(log: Log) -> StepMetrics:
    """Return the metrics of a manual step. DataError when the log has no row."""
    whole = run_metrics(log)
    time_s = log.column("time_s")
    names = ("temperature_c", "displacement_mm", "current_a", "voltage_v")
    is_end = time_s > time_s[-1] - END_S if not log.ended_by else time_s == time_s[-1]
    temperature_c, displacement_mm, current_a, voltage_v = (log.column_with_gaps(name)[is_end] for name in names)
    flows = current_a >= MEASURABLE * rig_config_of(log).limits.current_max_a
    return StepMetrics(
        _of_finite(np.median, temperature_c),
        whole.temperature_max_c,
        _of_finite(np.median, displacement_mm),
        _of_finite(np.median, current_a),
        _of_finite(np.median, voltage_v[flows] / current_a[flows]),
        whole.energy_j,
    )


def step_caveats(log: Log) -> tuple[str, ...]:
    """Return reasons to distrust a manual step: a temperature that was not reached, an unexpected resistance."""
    metrics, setpoint_c = step_metrics(log), step_of(log).temperature_c
    caveats = resistance_caveats(metrics.resistance_end_ohm, nominal_balance(log))
    if setpoint_c is None or not abs(metrics.temperature_end_c - setpoint_c) > NOT_REACHED_K:
        return caveats
    return (f"the step ended at {metrics.temperature_end_c:.1f} °C, and its setpoint was {setpoint_c:g} °C", *caveats)


def run_metrics(log: Log) -> RunMetrics:
    """Return the metrics of the run in `log`. DataError when the log has no row."""
    time_s = log.column("time_s")
    if time_s.size == 0:
        raise DataError("no tick was recorded", where=log.path, cure="record the run again")
    error = error_percent(log) if has_setpoint(log) else np.array([nan])
    power_w = log.column_with_gaps("current_a") * log.column_with_gaps("voltage_v")
    return RunMetrics(
        log.text("kind"),
        time_s.size,
        float(time_s[-1]),
        *_rms_and_max(error),
        _missed_deadlines(log),
        float(log.column("late_s").max()),
        _of_finite(np.max, log.column_with_gaps("temperature_c")),
        _of_finite(np.max, log.column_with_gaps("current_a")),
        float(np.nansum(power_w[1:] * np.diff(time_s))),
        100.0 * float(np.mean(log.column("limited"))),
    )


def _missed_deadlines(log: Log) -> int:
    return int(np.count_nonzero(log.column("late_s") > LATE_FRACTION / rig_config_of(log).rate_hz))


def _rms_and_max(values: Array) -> tuple[float, float]:
    """Return the RMS and the largest magnitude of the finite values. Both are NaN when no value is finite."""
    finite = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(finite**2))) if finite.size else nan, _of_finite(np.max, np.abs(finite))


def _of_finite(function: Callable[[Array], Any], values: Array) -> float:
    """Return `function` of the finite values, or NaN when no value is finite."""
    finite = values[np.isfinite(values)]
    return float(function(finite)) if finite.size else nan
