"""What a log tells of the run behind it: rig, experiment, wire, and how well the reference was followed."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from smadrive.configfile import validate
from smadrive.control.loop import LATE_FRACTION, LoopFigures
from smadrive.control.reference import Reference
from smadrive.errors import DataError
from smadrive.hysteresis import HysteresisModel
from smadrive.identification.excitation import Excitation, ExcitationRecord
from smadrive.rigconfig import RigConfig
from smadrive.telemetry.log import Log
from smadrive.thermal import HeatBalance
from smadrive.wirefile import parse_wire

Array = NDArray[np.float64]


def excitation_record(log: Log) -> ExcitationRecord:
    """The columns of a recorded excitation, all of them finite; DataError otherwise."""
    names = [field.name for field in fields(ExcitationRecord)]
    return ExcitationRecord(*(log.column(name) for name in names))


def logged_rig(log: Log) -> RigConfig:
    """The rig file that was in force. DataError, ConfigError when the log is of another version."""
    return validate(log.json("rig"), RigConfig, where=f"{log.path}: rig")


def nominal_balance(log: Log) -> HeatBalance:
    """The heat balance of the wire's data sheet."""
    return HeatBalance(**log.json("nominal_balance"))


def logged_excitation(log: Log) -> Excitation:
    """The experiment that was run. DataError when it was another one."""
    told = log.json("excitation")
    return Excitation(tuple(told["turning_points_c"]), told["rate_c_per_s"])


def logged_reference(log: Log) -> Reference:
    """The reference that was tracked, approach included. DataError when none was."""
    told = log.json("reference")
    return Reference(np.array(told["times_s"]), np.array(told["displacement_mm"]), told["scored_from_s"])


def logged_wire(log: Log) -> tuple[HysteresisModel, HeatBalance]:
    """Model and heat balance that tracked. DataError when none did."""
    log.json("wire")
    return parse_wire(log.about["wire"], f"{log.path}: wire")


def travel_mm(model: HysteresisModel) -> tuple[float, float]:
    """Displacement of the cold and of the fully heated wire: the ends of the model's major loop."""
    cold_c, hot_c = model.input_range
    return model.initial_state(cold_c).y, model.initial_state(hot_c).y


def error_percent(log: Log, model: HysteresisModel) -> Array:
    """Reference - displacement of every row, in % of the stroke of `model`; NaN where nothing was measured."""
    cold_mm, hot_mm = travel_mm(model)
    return 100.0 * (log.columns["reference_mm"] - log.columns["displacement_mm"]) / abs(hot_mm - cold_mm)


def missed_deadlines(log: Log) -> int:
    """How many of the recorded ticks began too late."""
    return int(np.count_nonzero(log.columns["late_s"] > LATE_FRACTION / logged_rig(log).rate_hz))


@dataclass(frozen=True)
class TrackingFigures:
    """How a run went: error = reference - displacement in % of the stroke, after the approach."""

    rms_percent: float
    max_percent: float
    ticks: int
    missed_deadlines: int
    trips: int
    log_file: str


def tracking_figures(log: Log, loop: LoopFigures) -> TrackingFigures:
    """The figures of a recorded tracking run. DataError when the rig has no displacement sensor to judge it by."""
    model, _ = logged_wire(log)
    scored = log.column("time_s") >= logged_reference(log).scored_from_s
    percent = error_percent(log, model)[scored]
    if percent.size == 0 or not np.all(np.isfinite(percent)):
        raise DataError(f"{log.path}: no displacement was measured: the tracking error is unknown")
    return TrackingFigures(
        float(np.sqrt(np.mean(percent**2))),
        float(np.max(np.abs(percent))),
        loop.ticks,
        loop.missed_deadlines,
        loop.trips,
        str(log.path),
    )
