"""Converts the arguments of a script to the types that the loop needs. A wrong type raises ConfigError."""

from __future__ import annotations

import os
from dataclasses import fields
from math import isfinite
from typing import Protocol

from smadrive.control.controllers.interface import Command
from smadrive.control.controllers.step import LONGEST_S, ManualStep
from smadrive.control.references.limits import check_rig_limits
from smadrive.control.references.reference import Reference
from smadrive.errors import ConfigError
from smadrive.files.number_text import shortened
from smadrive.measurement import DisplacementFrom, Measurement
from smadrive.numerics.scalars import real_number, whole_number
from smadrive.rig.config import LimitsConfig, RigConfig, load_rig
from smadrive.runs.cycling.cycles import Cycling
from smadrive.runs.experiments import read_reference
from smadrive.runs.tracking_plan import RETURN_S
from smadrive.wire.identified_wire import IdentifiedWire, load_wire
from smadrive.wire.wire_model import travel_mm

PathText = str | os.PathLike[str]
ReferenceLike = Reference | PathText
WireLike = IdentifiedWire | PathText


class ScriptController(Protocol):
    """A controller of the user. It returns one command per measurement; `time_s` counts from the start of the run."""

    def update(self, time_s: float, measurement: Measurement, dt_s: float) -> Command:
        """Return the command for the coming period. `dt_s` is the time since the previous call, in s."""
        ...


def rig_of(rig: RigConfig | PathText) -> RigConfig:
    """Return the configuration of `rig`, which is a shipped name, the path of a rig file, or a RigConfig."""
    if isinstance(rig, RigConfig):
        return rig
    return load_rig(os.fspath(path_text(rig, "rig", "a shipped name, the path of a rig file, or a RigConfig")))


def wire_of_argument(wire: WireLike) -> IdentifiedWire:
    """Return the identified wire, or load it from a file; raises the errors of `load_wire`."""
    if isinstance(wire, IdentifiedWire):
        return IdentifiedWire(**{field.name: getattr(wire, field.name) for field in fields(IdentifiedWire)})
    return load_wire(path_text(wire, "wire", "the result of smadrive.identify or load_wire, or the path of its file"))


def reference_of_argument(reference: ReferenceLike) -> Reference:
    """Return the reference, given as a shape, as a text as on the command line, or as the path of a CSV file."""
    if isinstance(reference, Reference):
        return reference
    wanted = "a shape such as smadrive.sine(…), a text such as 'sine:low_mm=…', or the path of a CSV file"
    return read_reference(os.fspath(path_text(reference, "reference", wanted)))


def source_of_argument(displacement_from: str | None) -> DisplacementFrom | None:
    """Return the source of the displacement; None (the rig file decides) for None. ConfigError for an unknown text."""
    if displacement_from is None:
        return None
    try:
        return DisplacementFrom(displacement_from)
    except ValueError:
        names = ", ".join(f'"{one}"' for one in DisplacementFrom)
        raise ConfigError(
            "not a source of the displacement",
            where="displacement_from",
            value=shortened(displacement_from),
            cure=f"choose one of {names}",
        ) from None


def step_of_arguments(duration_s: float, current_a: float | None, temperature_c: float | None) -> ManualStep:
    """Return the manual step. ConfigError for an argument that is not a number, and for an impossible step."""
    length_s = real_number(duration_s, "duration_s")
    held_a = None if current_a is None else real_number(current_a, "current_a")
    held_c = None if temperature_c is None else real_number(temperature_c, "temperature_c")
    return ManualStep(held_a, held_c, length_s)


def cycling_of_argument(reference: Reference, repeat: int | None) -> Cycling | None:
    """Return the plan of `repeat` cycles; None if `repeat` is None. ConfigError if `repeat` is no whole number >= 1."""
    if repeat is None:
        return None
    cycles = whole_number(repeat, "repeat", "cycles", 1)
    reference.repeated(cycles, RETURN_S)
    return Cycling(cycles)


def path_text(value: object, name: str, wanted: str) -> PathText:
    """Return `value` if it is a path or a text. ConfigError for another type, with the cure "pass `wanted`"."""
    if isinstance(value, str | os.PathLike):
        return value
    raise ConfigError("of the wrong type", where=name, value=type(value).__qualname__, cure=f"pass {wanted}")


def positive_number(value: object, name: str, *, may_be_zero: bool) -> float:
    """Return `value` as a float. ConfigError unless it is finite and above 0, or 0 if `may_be_zero`."""
    number = real_number(value, name)
    if not (number > 0.0 or (may_be_zero and number == 0.0)) or not isfinite(number):
        limit = "at least 0" if may_be_zero else "above 0"
        raise ConfigError("not possible", where=name, value=number, limit=limit, cure="give a number within the limit")
    return number


def cooling_time_s(duration_s: float) -> float:
    """Return `duration_s` as a float. ConfigError unless it is a number from 0 to `LONGEST_S`."""
    time_s = positive_number(duration_s, "duration_s", may_be_zero=True)
    if time_s > LONGEST_S:
        cure = "choose a shorter time"
        raise ConfigError("too long", where="duration_s", value=f"{time_s:g} s", limit=f"{LONGEST_S:g} s", cure=cure)
    return time_s


def travel_limits_mm(wire: IdentifiedWire) -> tuple[float, float]:
    """Return the smallest and the greatest displacement that the wire can reach, in mm."""
    ends_mm = travel_mm(wire.model)
    return min(ends_mm), max(ends_mm)


def permitted_mm(wire: IdentifiedWire, limits: LimitsConfig) -> tuple[float, float]:
    """Return the smallest and the greatest displacement that the wire can reach and the rig permits, in mm."""
    low_mm, high_mm = travel_limits_mm(wire)
    if limits.displacement_min_mm is not None:
        low_mm = max(low_mm, limits.displacement_min_mm)
    if limits.displacement_max_mm is not None:
        high_mm = min(high_mm, limits.displacement_max_mm)
    return low_mm, high_mm


def check_reference_within(reference: Reference, wire: IdentifiedWire, limits: LimitsConfig) -> None:
    """Raise ConfigError for a reference that leaves the travel of the wire, or exceeds a displacement limit."""
    reference.check_within(travel_limits_mm(wire))
    check_rig_limits(reference.scored_mm, limits.displacement_min_mm, limits.displacement_max_mm)


def check_displacement_within(displacement_mm: float, limits_mm: tuple[float, float]) -> None:
    """Raise ConfigError unless the displacement is a number within `limits_mm`, which `permitted_mm` returns."""
    low_mm, high_mm = limits_mm
    if not low_mm <= real_number(displacement_mm, "displacement_mm") <= high_mm:
        raise ConfigError(
            "outside the travel of the identified wire, or outside the displacement limits of the rig",
            where="displacement_mm",
            value=f"{displacement_mm:.6g} mm",
            limit=f"{low_mm:.6g} to {high_mm:.6g} mm",
            cure="choose a displacement within this range",
        )
