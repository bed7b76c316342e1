"""The tracking error of a run, and the time from which it is scored."""

from __future__ import annotations

from math import nan

import numpy as np

from smadrive.measurement import DisplacementFrom
from smadrive.numerics.arrays import FloatArray
from smadrive.runs.log.reader import Log
from smadrive.runs.metrics.series import of_finite, rms_and_max
from smadrive.runs.run_metadata import reference_of, wire_of
from smadrive.wire.wire_model import travel_mm

MOST_REPLACED = 0.5
"""If the sensor was replaced in a larger share of the scored samples, the tracking error of the run is unknown."""


def has_setpoint(log: Log) -> bool:
    """Return True for a tracking run, and for a run of the user's controller that returned displacement setpoints."""
    is_own = "controller" in log.metadata and bool(np.isfinite(log.column_with_gaps("setpoint_mm")).any())
    return "reference" in log.metadata or is_own


def scored_from_s(log: Log) -> float:
    """Return the time in s at which the metrics begin: the end of the approach, or 0 for a run without an approach."""
    return reference_of(log).scored_from_s if "reference" in log.metadata else 0.0


def measured_mm(log: Log) -> FloatArray:
    """Return the displacement in mm. It is NaN where it was not measured, and where the sensor was replaced.

    A sensor is replaced because its readings are wrong.
    """
    return np.where(_sensor_replaced(log), nan, log.column_with_gaps("displacement_mm"))


def _sensor_replaced(log: Log) -> FloatArray:
    """Return 1 for each row in which the displacement sensor was replaced, otherwise 0."""
    if "sensor_replaced" in log.columns:
        return log.column("sensor_replaced")
    if "uses_resistance" in log.columns and log.metadata.get("displacement_from") == DisplacementFrom.SENSOR:
        return log.column("uses_resistance")  # an older log
    return np.zeros(log.column("time_s").size)


def replaced_share(log: Log) -> float:
    """Return the share of the scored samples in which the sensor was replaced; NaN if no sample is scored."""
    return of_finite(np.mean, _sensor_replaced(log)[log.column("time_s") >= scored_from_s(log)])


def error_percent(log: Log) -> FloatArray:
    """Return setpoint minus displacement of every row, in % of the stroke.

    The error is NaN during the approach, and where `measured_mm` is NaN. DataError when the log is not of a run on an
    identified wire.
    """
    error_mm = log.column_with_gaps("setpoint_mm") - measured_mm(log)
    is_scored = log.column("time_s") >= scored_from_s(log)
    return np.where(is_scored, 100.0 * error_mm / travel_mm(wire_of(log).model).stroke_mm, nan)


def tracking_percent(log: Log) -> tuple[float, float]:
    """Return RMS and largest tracking error in % of the stroke, without a sample that tripped.

    Both are NaN if no displacement was measured, and after a run in which the sensor was replaced for more than
    `MOST_REPLACED`. DataError when the log is not of a run on an identified wire.
    """
    log = log.without_trips()
    return (nan, nan) if replaced_share(log) > MOST_REPLACED else rms_and_max(error_percent(log))
