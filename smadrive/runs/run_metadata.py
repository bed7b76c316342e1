"""What a log tells of the run behind it: rig, experiment, wire. DataError when it does not tell it."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from smadrive.control.references.reference import Reference
from smadrive.errors import DataError
from smadrive.files.config import validate
from smadrive.identification.excitation import Excitation, ExcitationRecord
from smadrive.rig.config import RigConfig
from smadrive.runs.log.reader import Log
from smadrive.wire.heat_balance import BalanceSource, HeatBalance
from smadrive.wire.identified_wire import IdentifiedWire, parse_wire

WHOLE = 0.98
"""Share of an experiment from which on it counts as complete."""


def excitation_record(log: Log) -> ExcitationRecord:
    """The columns of a recorded excitation, all of them finite; DataError otherwise."""
    names = [field.name for field in fields(ExcitationRecord)]
    return ExcitationRecord(*(log.column(name) for name in names))


def logged_rig(log: Log) -> RigConfig:
    """The rig file that was in force. DataError, ConfigError when the log is of another version."""
    return validate(log.json("rig"), RigConfig, where=f"{log.path}: rig")


def nominal_balance(log: Log) -> HeatBalance:
    """The heat balance of the wire's data sheet."""
    source = {"source": BalanceSource.DATA_SHEET}
    return log.parsed("nominal_balance", lambda parameters: HeatBalance(**(parameters | source)))


def logged_excitation(log: Log) -> Excitation:
    """The experiment that was run. DataError when it was another one."""
    return log.parsed("excitation", _excitation)


def excitation_caveats(log: Log) -> tuple[str, ...]:
    """What lets doubt a model that is identified from this log. DataError when the log is of another experiment."""
    wanted_s, done_s = logged_excitation(log).duration_s, float(_ticks(log)[-1])
    if done_s > WHOLE * wanted_s:
        return ()
    return (f"the experiment ended after {done_s:.0f} of its {wanted_s:.0f} s: the wire may do what it never showed",)


def logged_reference(log: Log) -> Reference:
    """The reference that was tracked, approach included. DataError when none was."""
    return log.parsed("reference", _reference)


def logged_wire(log: Log) -> IdentifiedWire:
    """The wire that tracked, with its heat balance. DataError when the log has none."""
    return parse_wire(log.text("wire"), f"{log.path}: wire")


def _excitation(fields: dict[str, Any]) -> Excitation:
    return Excitation(tuple(map(float, fields["turning_points_c"])), float(fields["rate_c_per_s"]))


def _reference(fields: dict[str, Any]) -> Reference:
    times_s, displacement_mm = (np.array(fields[name], np.float64) for name in ("times_s", "displacement_mm"))
    if times_s.shape != displacement_mm.shape or times_s.ndim != 1 or times_s.size < 2:
        raise ValueError(f"{times_s.shape} times and {displacement_mm.shape} displacements")
    if not (np.isfinite(displacement_mm).all() and (np.diff(times_s) > 0.0).all()):
        raise ValueError("its times do not increase, or a displacement is not finite")
    return Reference(times_s, displacement_mm, float(fields["scored_from_s"]), bool(fields["endless"]))


def _ticks(log: Log) -> NDArray[np.float64]:
    """When each tick was; DataError when none was recorded."""
    time_s = log.column("time_s")
    if time_s.size == 0:
        raise DataError(f"{log.path}: no tick was recorded: run the experiment again")
    return time_s
