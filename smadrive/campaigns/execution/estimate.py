"""Time and disk space of a campaign, estimated before it starts.

The time of a run is estimated as its number of ticks times the time of one tick. The time of one tick is measured
before the start, on the rig of the first run that can be driven; without such a run, a tick counts as `TYPICAL_TICK_S`.
A fit counts as a number of ticks that depends on its kind, because a search for memory takes far longer than a fit
without memory; the length of the record hardly matters. The smoothing of a reference counts as a fixed number of ticks
per tick of the run. These numbers were measured once.

A run that cannot be driven is no error here. It becomes a failed row, which the other runs do not depend on.
"""

from __future__ import annotations

import os
import shutil
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from smadrive.campaigns.experiments.references import typical_reference
from smadrive.campaigns.experiments.run import needs_identification
from smadrive.campaigns.experiments.simulated_rig import TRACKING, SimulatedRig
from smadrive.campaigns.plan.plan import CampaignPlan, PlannedRun
from smadrive.control.controllers.step import ConstantCurrentController
from smadrive.control.references.holding import APPROACH_S
from smadrive.errors import DataError, SmadriveError
from smadrive.rig.controllers import excitation_path

PROBE_S = 5.0
"""Length of the simulated run that measures the time of one tick, s."""

TYPICAL_TICK_S = 3e-4
"""The processor time of one tick where it cannot be measured, s."""

DUHEM_TICKS, RULES_TICKS, PLANE_TICKS = 4_000, 12_000, 30_000
"""The time of a fit, in ticks: of a Duhem model, of fuzzy rules, and of rules with a memory of a given size."""

MEMORY_TICKS, RANDOM_TICKS = 75_000, 25_000
"""The same if the record decides on the memory: for a Preisach wire, and the mean over wires of unknown kind.

For a wire without memory, it is that of fuzzy rules.
"""

SMOOTHING_TICKS = 1.5
"""The time of the simulation that smooths a reference, in ticks per tick of the run."""

SETUP_TICKS = 200
"""The time that a run needs besides its ticks, in ticks."""

ROW_BYTES = 1600
"""Bytes of a run in the journal and in the tables."""

TICK_BYTES, LOG_BYTES = 180, 300_000
"""Bytes of a tick in a log, and of the metadata of a log."""

PAGE_BYTES = 2_000_000
SPARE = 2.0
"""The disk must have this many times the estimated space."""

WORKER_BYTES = 340_000_000
"""Largest memory that a worker needs, measured, in bytes."""


class CampaignEstimate(NamedTuple):
    """The estimated work of a campaign.

    runs              number of runs
    identifications   number of identifications that these runs share
    ticks             processor time in ticks
    tick_s            processor time of one tick, s
    disk_bytes        bytes on the disk
    """

    runs: int
    identifications: int
    ticks: float
    tick_s: float
    disk_bytes: float

    @property
    def core_s(self) -> float:
        """The time on one core, s."""
        return self.ticks * self.tick_s


def estimated(plan: CampaignPlan, groups: list[list[int]]) -> CampaignEstimate:
    """Return the estimate for the runs in `groups`. The runs of a group share one identification.

    The time contains the second execution of the worst runs, for their logs.
    """
    left = [number for group in groups for number in group]
    numbers = left or range(plan.count)
    sampled = [
        plan.run(numbers[place]) for place in np.linspace(0, len(numbers) - 1, min(100, len(numbers)), dtype=int)
    ]
    experiment, identifies = sampled[0].settings.experiment, needs_identification(sampled[0])
    identifications = len(groups) if identifies else 0
    identifying = _mean(_identification_ticks, sampled) if identifies else 0.0
    executing = _mean(_fit_ticks if experiment == "fit" else _tracking_ticks, sampled)
    logged = min(plan.config.report.worst_logs, plan.count) if experiment == "track" else 0
    ticks = len(left) * executing + identifications * identifying + logged * (executing + identifying)
    log_bytes = _mean(_driven_ticks, sampled) * TICK_BYTES + LOG_BYTES if logged else 0.0
    disk_bytes = len(left) * ROW_BYTES + logged * log_bytes + PAGE_BYTES
    return CampaignEstimate(len(left), identifications, ticks, tick_s(sampled), disk_bytes)


def check_disk(folder: Path, estimate: CampaignEstimate) -> None:
    """Raise DataError if the disk of `folder` is too small for the campaign."""
    place = next(parent for parent in (folder.absolute(), *folder.absolute().parents) if os.path.exists(parent))
    free = shutil.disk_usage(place).free
    if free < SPARE * estimate.disk_bytes:
        value, limit = f"{free / 1e6:.0f} MB free", f"{SPARE * estimate.disk_bytes / 1e6:.0f} MB"
        raise DataError("the disk is too small", where=folder, value=value, limit=limit, cure="choose another folder")


def memory_caveats(workers: int, memory_bytes: int) -> list[str]:
    """Return a warning if this machine, with `memory_bytes` of memory, is too small for this number of workers."""
    if memory_bytes >= workers * WORKER_BYTES:
        return []
    needed, has = (f"{value / 1e6:.0f} MB" for value in (workers * WORKER_BYTES, memory_bytes))
    most = max(1, memory_bytes // WORKER_BYTES)
    cure = f"; choose at most --workers {most}" if most < workers else ""
    return [f"{workers} workers may need {needed} of memory, and this machine has {has}{cure}"]


def tick_s(runs: Sequence[PlannedRun]) -> float:
    """Return the processor time of one tick, s: on the rig of the first of `runs` that can be driven, if any.

    The heater stays off.
    """
    for run in runs:
        try:
            return _measured_tick_s(run)
        except SmadriveError:
            continue
    return TYPICAL_TICK_S


def _measured_tick_s(run: PlannedRun) -> float:
    simulated, count = SimulatedRig(run, run.documents.sim, TRACKING), [0]

    def record(_tick: object) -> None:
        count[0] += 1

    with simulated.rig as rig:
        began_s = time.process_time()
        rig.drive(ConstantCurrentController(0.0, PROBE_S), rig.nominal_balance, record)
        return (time.process_time() - began_s) / max(count[0], 1)


def _mean(ticks: Callable[[PlannedRun], float], runs: Sequence[PlannedRun]) -> float:
    """Return the mean number of ticks. A run whose path cannot be planned has none: it fails before its first tick."""

    def planned(run: PlannedRun) -> float:
        try:
            return ticks(run)
        except SmadriveError:
            return 0.0

    return float(np.mean([planned(run) for run in runs]))


def _identification_ticks(run: PlannedRun) -> float:
    rig, ambient_c = run.documents.rig, run.documents.sim.wire.ambient_c
    return rig.rate_hz * excitation_path(rig.excitation, ambient_c).duration_s + _fit_ticks(run)


def _fit_ticks(run: PlannedRun) -> float:
    fit = run.settings.fit
    if fit.kind == "duhem":
        return DUHEM_TICKS
    if fit.memory is not None:
        return RULES_TICKS if fit.memory == 1 else PLANE_TICKS
    kind = _wire_kind(run)
    return RANDOM_TICKS if kind is None else MEMORY_TICKS if kind == "preisach" else RULES_TICKS


def _wire_kind(run: PlannedRun) -> str | None:
    """Return the kind of hysteresis of the wire, or None if it is random, or if the run fits the record of a user."""
    if run.settings.experiment == "fit":
        return None
    return run.documents.sim.transformation.kind if run.settings.wire.seed is None else run.settings.wire.kind


def _tracking_ticks(run: PlannedRun) -> float:
    if run.reference is None or run.settings.experiment != "track":
        return 0.0
    ticks = _driven_ticks(run) * (1.0 + SMOOTHING_TICKS * run.reference.smooth) + SETUP_TICKS
    return ticks + DUHEM_TICKS if run.settings.controller == "duhem-inverse" else ticks


def _driven_ticks(run: PlannedRun) -> float:
    """Return the number of ticks in which the run tracks its reference, which are those of its log."""
    return run.documents.rig.rate_hz * (_reference_s(run) + APPROACH_S)


def _reference_s(run: PlannedRun) -> float:
    """Return the duration of the reference of a run, without its approach."""
    assert run.reference is not None
    return typical_reference(run.reference).duration_s
