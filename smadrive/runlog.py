"""The log of one run of a rig: ticks become rows, the rig's config its attributes, the tracking error its figures."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, fields
from math import isfinite
from pathlib import Path

import numpy as np

from smadrive.control.loop import LoopFigures, Tick
from smadrive.control.reference import Reference
from smadrive.errors import DataError
from smadrive.hysteresis import HysteresisModel
from smadrive.identification.excitation import ExcitationRecord
from smadrive.rig import Rig
from smadrive.telemetry.log import Log
from smadrive.telemetry.recorder import Recorder


def open_recorder(path: Path, rig: Rig, kind: str) -> Recorder:
    """A log that tells by itself what was run on which rig, with what nominal wire."""
    return Recorder(
        path,
        {
            "kind": kind,
            "rig": rig.config.model_dump_json(),
            "device": ", ".join(f"{name}: {identity}" for name, identity in rig.identities.items()),
            "nominal_balance": json.dumps(asdict(rig.nominal_balance)),
        },
    )


def excitation_record(log: Log) -> ExcitationRecord:
    """The columns of a recorded excitation, all of them finite; DataError otherwise."""
    names = [field.name for field in fields(ExcitationRecord)]
    return ExcitationRecord(*(log.column(name) for name in names))


def row(tick: Tick) -> dict[str, float]:
    """The columns of a log, in the order of their importance to a reader."""
    measurement, command = tick.measurement, tick.command
    return {
        "time_s": tick.time_s,
        "temperature_c": measurement.temperature_c,
        "displacement_mm": measurement.displacement_mm,
        "current_a": measurement.current_a,
        "voltage_v": measurement.voltage_v,
        "reference_mm": command.wanted_mm,
        "wanted_c": command.wanted_c,
        "estimated_c": command.estimated_c,
        "estimated_mm": command.estimated_mm,
        "power_w": command.power_w,
        "commanded_a": command.current_a,
        "late_s": tick.late_s,
    }


def travel_mm(model: HysteresisModel) -> tuple[float, float]:
    """Displacement of the cold and of the fully heated wire: the ends of the model's major loop."""
    cold_c, hot_c = model.input_range
    return model.initial_state(cold_c).y, model.initial_state(hot_c).y


@dataclass(frozen=True)
class TrackingFigures:
    """How a run went: error = reference - displacement in % of the stroke, after the approach."""

    rms_percent: float
    max_percent: float
    ticks: int
    missed_deadlines: int
    trips: int
    log_file: str


def tracking_figures(log: Log, reference: Reference, model: HysteresisModel, loop: LoopFigures) -> TrackingFigures:
    """The figures of a recorded tracking run. DataError when the rig has no displacement sensor to judge it by."""
    cold_mm, hot_mm = travel_mm(model)
    scored = log.column("time_s") >= reference.scored_from_s
    error = (log.column("reference_mm") - log.columns["displacement_mm"])[scored]
    if not isfinite(float(np.sum(error))) or error.size == 0:
        raise DataError(f"{log.path}: no displacement was measured: the tracking error is unknown")
    percent = 100.0 * error / abs(hot_mm - cold_mm)
    return TrackingFigures(
        float(np.sqrt(np.mean(percent**2))),
        float(np.max(np.abs(percent))),
        loop.ticks,
        loop.missed_deadlines,
        loop.trips,
        str(log.path),
    )
