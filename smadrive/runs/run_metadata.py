"""The metadata of a log as typed values: rig, experiment, wire. DataError when the log does not hold them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from smadrive.control.controllers.step import ManualStep
from smadrive.control.references.reference import Reference
from smadrive.errors import DataError
from smadrive.files.config import validate
from smadrive.identification.column_units import stroke_caveats, unit_caveats
from smadrive.identification.excitation import Excitation, ExcitationRecord
from smadrive.measurement import DisplacementFrom
from smadrive.numerics.arrays import FloatArray
from smadrive.numerics.held_readings import between_readings
from smadrive.rig.checks.sensing import measures_resistance_by
from smadrive.rig.config import RigConfig
from smadrive.runs.log.reader import Log
from smadrive.runs.run_kind import RunKind
from smadrive.wire.heat_balance import BalanceSource, HeatBalance
from smadrive.wire.identified_wire import IdentifiedWire, parse_wire

IDENTIFIABLE = (
    "give the log of `smadrive excite` or rig.excite; to fit the columns of this log anyway, write them with "
    "`smadrive report LOG --csv FILE` and give that CSV"
)
"""The cure for a log from which no wire can be identified."""

COMPLETE = 0.98
"""An experiment that reached this share of its duration counts as complete, unless its log says that it ended early."""

RECORDED = tuple(field.name for field in fields(ExcitationRecord))
"""The columns from which a wire is identified."""

LEAST_VALID, FEW_INVALID = 0.8, 0.01
"""Least share of samples with all values in a usable record, and largest share without them that is no caveat."""


def measures_resistance(log: Log) -> bool:
    """Return False if the heat source of the run did not measure current and voltage, but computed them.

    DataError if the log does not hold the profiles of its devices.
    """
    return log.parsed("profiles", lambda profiles: any(map(measures_resistance_by, profiles.values())))


def excitation_record(log: Log) -> ExcitationRecord:
    """Return the columns from which a wire is identified.

    A measurement that tripped is left out, because it may be invalid, and so is a sample that lacks a value. The
    displacement is that at the time of the sample, also if its sensor is slower than the loop. The temperature stays
    the latest reading: the age of a slow thermometer is a part of its fitted lag, with which a run uses it. DataError
    for a log of another experiment, and when more than a few samples lack a value (`LEAST_VALID`).
    """
    if log.kind is not RunKind.EXCITATION:
        raise DataError("not the log of an excitation", where=log.path, value=log.kind.value, cure=IDENTIFIABLE)
    accepted = log.without_trips()
    if "displacement_mm" in accepted.columns:
        in_time_mm = displacement_in_time(accepted)
        accepted = replace(accepted, columns={**accepted.columns, "displacement_mm": in_time_mm})
    valid = _valid_rows(accepted)
    if np.count_nonzero(valid) >= LEAST_VALID * valid.size:
        accepted = accepted.rows(valid)
    return ExcitationRecord(*(accepted.column(name) for name in RECORDED))


def displacement_in_time(log: Log) -> FloatArray:
    """Return the displacement at the time of each row, mm, also if its sensor is slower than the loop.

    It is NaN where the row has no valid reading. Logs of older versions do not hold the age of a reading; their
    displacement is returned as it is.
    """
    latest_mm = log.column_with_gaps("displacement_mm")
    if "displacement_age_s" not in log.columns:
        return latest_mm
    return between_readings(log.column_with_gaps("time_s"), log.column_with_gaps("displacement_age_s"), latest_mm)


def _valid_rows(log: Log) -> NDArray[np.bool_]:
    """Return True for each row that has a finite value in every column of `RECORDED`."""
    recorded = [log.column_with_gaps(name) for name in RECORDED if name in log.columns]
    return np.asarray(np.isfinite(recorded).all(axis=0))


def rig_config_of(log: Log) -> RigConfig:
    """Return the rig file of the run. ConfigError when the log is from a version of smadrive with other keys."""
    return validate(log.json("rig"), RigConfig, where=f"{log.path}: rig")


def nominal_balance(log: Log) -> HeatBalance:
    """Return the heat balance that the data sheet of the wire gave at the time of the run."""
    source = {"source": BalanceSource.DATA_SHEET}
    return log.parsed("nominal_balance", lambda parameters: HeatBalance(**(parameters | source)))


def excitation_of(log: Log) -> Excitation:
    """Return the excitation of an identification experiment. DataError when the log is of another experiment."""
    return log.parsed("excitation", _excitation)


def excitation_caveats(log: Log) -> tuple[str, ...]:
    """Return reasons to distrust a model identified from this log. DataError for a log of another experiment."""
    return (*_end_caveats(log), *_gap_caveats(log), *_stroke_caveats(log))


def _end_caveats(log: Log) -> tuple[str, ...]:
    """Return a caveat if the experiment ended early.

    The time alone does not show this, because a path that has waited for the wire takes longer than planned.
    """
    planned_s, recorded_s = excitation_of(log).duration_s, float(_times_s(log)[-1])
    if log.end_time and not log.ended_by and recorded_s > COMPLETE * planned_s:
        return ()
    planned = f"{planned_s:.0f} s, and the time for which its path waited, were planned"
    return (f"the experiment ended early, after {recorded_s:.0f} s ({planned}): a part of the behaviour is missing",)


def _gap_caveats(log: Log) -> tuple[str, ...]:
    """Return a caveat if more than a few samples are left out because they lack a value."""
    valid = _valid_rows(log.without_trips())
    invalid = valid.size - int(np.count_nonzero(valid))
    if invalid <= FEW_INVALID * valid.size:
        return ()
    share = f"{invalid} of {valid.size} samples ({100.0 * invalid / valid.size:.0f} %)"
    return (f"{share} lack a valid value and are left out: check the sensors, and record the excitation again",)


def _stroke_caveats(log: Log) -> tuple[str, ...]:
    """Return the caveats about the displacement.

    A log of version 0.1 does not hold the length of the wire, so only the unit is checked.
    """
    displacement_mm = log.without_trips().columns.get("displacement_mm", np.empty(0))
    displacement_mm = displacement_mm[np.isfinite(displacement_mm)]
    if not displacement_mm.size:
        return ()
    if "data_sheet" not in log.metadata:
        return unit_caveats("displacement_mm", displacement_mm)
    length_mm = log.parsed("data_sheet", lambda sheet: float(sheet["length_mm"]))
    return stroke_caveats(displacement_mm, length_mm)


def step_of(log: Log) -> ManualStep:
    """Return the manual step of a run of `heat`. DataError for a log of another experiment."""
    return log.parsed("step", lambda values: ManualStep(**values))


def reference_of(log: Log) -> Reference:
    """Return the reference of a tracking run, including its approach. DataError for a log of another experiment."""
    return log.parsed("reference", _reference)


def wire_of(log: Log) -> IdentifiedWire:
    """Return the identified wire of a run, with its heat balance. DataError when the run used no identified wire."""
    return parse_wire(log.text("wire"), f"{log.path}: wire")


def displacement_source_of(log: Log) -> DisplacementFrom | None:
    """Return the source of the displacement of a tracking run; None for a log that does not name it.

    DataError for an unknown source.
    """
    if "displacement_from" not in log.metadata:
        return None
    source = log.metadata["displacement_from"]
    try:
        return DisplacementFrom(source)
    except ValueError:
        cure = "update smadrive"
        raise DataError("unknown source of the displacement", where=log.path, value=source, cure=cure) from None


def texts_of(log: Log, name: str) -> tuple[str, ...]:
    """Return the list of texts `name` of the metadata. It is empty when the log has no such list."""
    return log.parsed(name, _texts) if name in log.metadata else ()


def _texts(values: Iterable[Any]) -> tuple[str, ...]:
    return tuple(map(str, values))


def _excitation(values: dict[str, Any]) -> Excitation:
    """Return the excitation. A log of version 0.1 does not name the plan, which was `nested` there."""
    points = tuple(map(float, values["turning_points_c"]))
    return Excitation(points, float(values["rate_c_per_s"]), str(values.get("plan", "nested")))


def _reference(values: dict[str, Any]) -> Reference:
    times_s, displacement_mm = (np.array(values[name], np.float64) for name in ("times_s", "displacement_mm"))
    if times_s.shape != displacement_mm.shape or times_s.ndim != 1 or times_s.size < 2:
        raise ValueError(f"times of shape {times_s.shape} do not fit displacements of shape {displacement_mm.shape}")
    if not (np.isfinite(displacement_mm).all() and (np.diff(times_s) > 0.0).all()):
        raise ValueError("the times do not increase, or a displacement is not finite")
    repeats = int(values.get("repeats", 1))
    return Reference(times_s, displacement_mm, float(values["scored_from_s"]), bool(values["endless"]), repeats)


def _times_s(log: Log) -> NDArray[np.float64]:
    """Return the time of each tick. DataError when the log has no row."""
    times_s = log.column("time_s")
    if times_s.size == 0:
        raise DataError("no tick was recorded", where=log.path, cure="run the experiment again")
    return times_s
