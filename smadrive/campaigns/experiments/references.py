"""The reference of a tracking run, scaled to the identified travel of its wire.

Phase 0 is the displacement of the cold wire, phase 1 the displacement of the hot wire.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from smadrive.campaigns.plan.config import ReferenceConfig
from smadrive.control.feasibility.simulation import simulate_run
from smadrive.control.feedforward.displacement import HysteresisInverse
from smadrive.control.references.holding import APPROACH_S
from smadrive.control.references.limits import check_rig_limits
from smadrive.control.references.reference import Reference
from smadrive.control.references.shapes import parse_reference
from smadrive.files.csv_table import read_table
from smadrive.rig.config import RigConfig
from smadrive.rig.controllers import tracking_settings
from smadrive.wire.wire_model import Travel, WireModel, WireState, travel_mm

TYPICAL_TRAVEL = Travel(cold_mm=0.0, hot_mm=10.0)
"""The travel on which a reference is checked before the travel of its wire is identified."""


class PlannedReference(NamedTuple):
    """The reference that a run tracks. `smoothed` is True if the wire could not follow the requested one."""

    reference: Reference
    smoothed: bool


def planned_reference(config: ReferenceConfig, wire: WireModel, rig: RigConfig) -> PlannedReference:
    """Return the reference with the approach from the cold wire; with `smooth`, the nearest one that it can follow.

    ConfigError for a reference outside the travel of the wire or the displacement limits of the rig, DataError for an
    unusable table.
    """
    travel = travel_mm(wire.model)
    requested = _requested(config, travel)
    check_rig_limits(requested.scored_mm, rig.limits.displacement_min_mm, rig.limits.displacement_max_mm)
    requested.check_within(travel)
    path = requested.with_approach(travel.cold_mm, APPROACH_S)
    if not config.smooth:
        return PlannedReference(path, smoothed=False)
    ambient_c = wire.balance.ambient_c
    start = WireState(ambient_c, wire.model.initial_state(ambient_c))
    simulated = simulate_run(path, wire, HysteresisInverse(wire.model), tracking_settings(rig), start)
    return PlannedReference(simulated.nearest, not simulated.feasible)


def typical_reference(config: ReferenceConfig) -> Reference:
    """Return the reference on a typical travel, without an approach.

    ConfigError, or DataError, if no wire can have this reference: its shape or its table is malformed.
    """
    return _requested(config, TYPICAL_TRAVEL)


def _requested(config: ReferenceConfig, travel: Travel) -> Reference:
    if config.file is not None:
        return _from_table(Path(config.file), travel)
    assert config.shape is not None
    if not config.is_scaled:
        return parse_reference(config.shape)
    separator = "," if ":" in config.shape else ":"
    low_mm, high_mm = travel.at_mm(config.low), travel.at_mm(config.high)
    return parse_reference(f"{config.shape}{separator}low_mm={low_mm!r},high_mm={high_mm!r}")


def _from_table(path: Path, travel: Travel) -> Reference:
    table = read_table(path)
    times_s = table.column("time_s")
    if "phase" not in table.cells:
        return Reference.from_samples(times_s, table.column("displacement_mm"))
    return Reference.from_samples(times_s, travel.at_mm(table.column("phase")))
