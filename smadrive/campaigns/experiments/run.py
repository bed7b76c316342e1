"""The tasks of a campaign: identify the wire of a run, execute a run. A failed run is a row with its error.

The result of a task depends on its arguments alone, so a task may be repeated on another worker. The files that a task
reads are compared with their content at the start of the campaign.

A failure is final if its error comes from the run, or from a defect of smadrive: each repetition would fail in the same
way. An error of `OF_THE_WORKER` says nothing about the run, so the failure is not final.
"""

from __future__ import annotations

import hashlib
import os
import platform
import time
import traceback
from datetime import UTC, datetime
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

from smadrive.campaigns.experiments.columns import Row, outcome_row
from smadrive.campaigns.experiments.identification import (
    WireKnowledge,
    excited_wire,
    fit_row,
    identification_row,
    wire_of_model,
)
from smadrive.campaigns.experiments.simulated_rig import simulated_wire, wire_row
from smadrive.campaigns.experiments.tracking import tracking_row
from smadrive.campaigns.plan.files import ChangedFileError, RunFile, of_unchanged_files
from smadrive.campaigns.plan.plan import PlannedRun
from smadrive.errors import DataError, SmadriveError

OF_THE_WORKER = (MemoryError, OSError, ImportError, ChangedFileError)
"""Errors of the machine that executes a run: too little memory, a full disk, a missing package, a changed file."""


class RunFailure(NamedTuple):
    """A failed identification or run: the columns `STATE` of its row, and the traceback of an unexpected error, or "".

    `cpu_s` is the processor time of a failed identification.
    """

    outcome: Row
    trace: str
    is_final: bool
    cpu_s: float = 0.0


class Effort(NamedTuple):
    """The effort of a run. These values differ if the run is repeated.

    began                  beginning of the run, UTC, ISO 8601
    duration_s             duration of the run
    cpu_s                  processor time of the run, without its identification
    identification_cpu_s   processor time of the identification, which other runs may share
    process                host:pid of the worker
    trace                  traceback of an unexpected error, or empty
    """

    began: str
    duration_s: float
    cpu_s: float
    identification_cpu_s: float
    process: str
    trace: str = ""


class RunResult(NamedTuple):
    """The row of a run without its axes, and its effort. Without `is_final`, `--resume` repeats the run."""

    row: Row
    effort: Effort
    is_final: bool = True


def needs_identification(run: PlannedRun) -> bool:
    """Return True if the run excites and identifies its wire."""
    return run.settings.experiment != "fit" and run.settings.model is None


def identification_key(run: PlannedRun) -> str:
    """Return a name for the identification of a run. Runs with the same name share one identification."""
    settings = run.settings
    parts = run.documents.excitation_digest, settings.sim, settings.wire, settings.seed, settings.fit
    return f"identification-{hashlib.sha256(repr(parts).encode()).hexdigest()[:24]}"


def identify(run: PlannedRun) -> WireKnowledge | RunFailure:
    """Excite and identify the wire of a run.

    An error is returned as a result: every run that needs this wire fails with it.
    """
    began_s = time.thread_time()
    try:
        knowledge = of_unchanged_files(run.documents.profiles, lambda: excited_wire(run))
        return knowledge._replace(cpu_s=time.thread_time() - began_s)
    except Exception as error:  # noqa: BLE001 (a defect in one run must not end the campaign)
        return _failure(run, error)._replace(cpu_s=time.thread_time() - began_s)


def execute(run: PlannedRun, knowledge: WireKnowledge | RunFailure | None = None) -> RunResult:
    """Execute a run and return its row. `knowledge` is the result of `identify` if the run needs one."""
    began, clock_s, cpu_s = datetime.now(UTC), time.monotonic(), time.thread_time()
    row, trace, is_final = _outcome(run, knowledge)
    effort = Effort(
        began.isoformat(timespec="milliseconds"),
        time.monotonic() - clock_s,
        time.thread_time() - cpu_s,
        0.0 if knowledge is None else knowledge.cpu_s,
        f"{platform.node()}:{os.getpid()}",
        trace,
    )
    return RunResult(row, effort, is_final)


def logged_run(run: PlannedRun) -> bytes:
    """Execute a tracking run again with a log, and return the content of the log.

    DataError when the folder for temporary files cannot be used, ChangedFileError when a file of the run has changed.
    """
    try:
        with TemporaryDirectory() as folder:
            log_file = Path(folder) / "run.h5"
            of_unchanged_files(_files_of(run), lambda: tracking_row(run, _knowledge(run), log_file))
            return log_file.read_bytes()
    except OSError as error:
        where, cure = f"folder for temporary files on {platform.node()}", "make room there, and go on with --resume"
        raise DataError("no log can be written", where=where, value=error.strerror, cure=cure) from None


def _outcome(run: PlannedRun, knowledge: WireKnowledge | RunFailure | None) -> tuple[Row, str, bool]:
    """Return the row of a run, the traceback of an unexpected error, and True if the result is final."""
    if isinstance(knowledge, RunFailure):
        failure = knowledge
    else:
        try:
            return of_unchanged_files(_files_of(run), lambda: _row(run, knowledge)), "", True
        except Exception as error:  # noqa: BLE001 (a defect in one run must not end the campaign)
            failure = _failure(run, error)
    return {**_wire_row_if_simulated(run), **failure.outcome}, failure.trace, failure.is_final


def _failure(run: PlannedRun, error: Exception) -> RunFailure:
    """Return the failure of a run by `error`, the exception that is handled now.

    Files are named relative to the campaign file: the row must not depend on the folder.
    """
    text, trace = str(error), "" if isinstance(error, SmadriveError) else traceback.format_exc()
    names = (run.documents.rig.wire, *(file.name for file in _files_of(run)))
    for path in sorted(filter(os.path.isabs, names), key=len, reverse=True):  # a path can begin with a shorter one
        text = text.replace(path, os.path.relpath(path, run.folder))
    return RunFailure(outcome_row("failed", error, text), trace, not isinstance(error, OF_THE_WORKER))


def _files_of(run: PlannedRun) -> tuple[RunFile, ...]:
    """Return the files that a worker reads for the run."""
    return (*run.documents.profiles, *run.files)


def _row(run: PlannedRun, knowledge: WireKnowledge | None) -> Row:
    if run.settings.experiment == "fit":
        return fit_row(run)
    knowledge = knowledge or _knowledge(run)
    if run.settings.experiment == "identify":
        return identification_row(run, knowledge)
    return tracking_row(run, knowledge)


def _knowledge(run: PlannedRun) -> WireKnowledge:
    return excited_wire(run) if run.settings.model is None else wire_of_model(run.settings.model)


def _wire_row_if_simulated(run: PlannedRun) -> Row:
    """Return the true parameters of the wire of a failed run: none for a fit, or for a wire that is impossible.

    An error of `OF_THE_WORKER` is raised.
    """
    if run.settings.experiment == "fit":
        return {}
    try:
        return wire_row(simulated_wire(run))
    except OF_THE_WORKER:
        raise
    except Exception:  # noqa: BLE001 (a defect in one run must not end the campaign)
        return {}  # the run has failed with the same error
