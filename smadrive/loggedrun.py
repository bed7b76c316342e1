"""What a log tells of the run behind it: rig, experiment, wire. DataError when it does not tell it."""

from __future__ import annotations

from dataclasses import fields

import numpy as np

from smadrive.configfile import validate
from smadrive.control.reference import Reference
from smadrive.hysteresis import HysteresisModel
from smadrive.identification.excitation import Excitation, ExcitationRecord
from smadrive.rigconfig import RigConfig
from smadrive.telemetry.log import Log
from smadrive.thermal import HeatBalance
from smadrive.wirefile import parse_wire

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
    return HeatBalance(**log.json("nominal_balance"))


def logged_excitation(log: Log) -> Excitation:
    """The experiment that was run. DataError when it was another one."""
    told = log.json("excitation")
    return Excitation(tuple(told["turning_points_c"]), told["rate_c_per_s"])


def excitation_caveats(log: Log) -> tuple[str, ...]:
    """What lets doubt a model that is identified from this log. DataError when the log is of another experiment."""
    wanted_s, done_s = logged_excitation(log).duration_s, float(log.column("time_s")[-1])
    if done_s > WHOLE * wanted_s:
        return ()
    return (f"the experiment ended after {done_s:.0f} of its {wanted_s:.0f} s: the wire may do what it never showed",)


def logged_reference(log: Log) -> Reference:
    """The reference that was tracked, approach included. DataError when none was."""
    told = log.json("reference")
    times_s, displacement_mm = np.array(told["times_s"]), np.array(told["displacement_mm"])
    return Reference(times_s, displacement_mm, told["scored_from_s"], told["endless"])


def logged_wire(log: Log) -> tuple[HysteresisModel, HeatBalance]:
    """Model and heat balance that tracked. DataError when none did."""
    log.json("wire")
    return parse_wire(log.about["wire"], f"{log.path}: wire")
