"""Reads a log back into memory: its columns, its metadata and its events.

A log can be read while it is written (see writer.py). It then ends with the last complete row, and so does the log of
a writer that was killed. Checksums verify the content.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import h5py
import numpy as np
from numpy.typing import NDArray

from smadrive.display.ascii_text import ascii_text
from smadrive.errors import DataError, SmadriveError, TripError
from smadrive.files.kinds import LOG, check_kind
from smadrive.files.spelling import missing_file_cure, suggestion_or_list
from smadrive.numerics.arrays import FloatArray
from smadrive.runs.log.content import Content, read_content
from smadrive.runs.log.errors import DamageError, ForeignContentError, NewerLayoutError
from smadrive.runs.log.old_layouts import LAYOUT
from smadrive.runs.run_kind import RunKind

ValueT = TypeVar("ValueT")

ENDED_BY = "ended by "
"""The first words of the event that gives the cause of the early end of a run."""

INTERRUPTION, STOP = "interruption", "emergency stop"
"""The first words of the cause if the user has ended the run, by a signal or by an emergency stop."""

RESTORE = "restore the log from a copy, or record it again"
COPY_AGAIN = "copy the whole file again, or record it again; was the disk full, or the copy interrupted?"
CONVERT = "update smadrive, or copy the columns into a CSV with h5py (docs/records.md)"

_CUT = re.compile(r"truncated file: eof = (?P<found>\d+),.* stored_eof = (?P<stored>\d+)")
"""The message of HDF5 for a file that is shorter than its superblock states."""


class RunEvent(NamedTuple):
    """An event of a run.

    `time_s` is the time of the last row before the event. Events of a tuning session have their own time.
    """

    time_s: float
    message: str


@dataclass(frozen=True, repr=False)
class Log:
    """The content of a log file.

    columns          arrays of the same length, by the name of the column
    metadata         texts by their names, for example rig, wire, reference and versions
    end_time         empty if the writer was killed, or still writes
    version          version of smadrive that wrote the log
    has_checksums    True if checksums have verified the content
    """

    path: Path
    columns: Mapping[str, FloatArray]
    metadata: Mapping[str, str]
    events: tuple[RunEvent, ...]
    start_time: str
    end_time: str
    version: str
    has_checksums: bool = True

    def __repr__(self) -> str:
        rows = len(next(iter(self.columns.values()), ()))
        kind = self.metadata.get("kind", "unknown kind")
        return ascii_text(f"Log({self.path}, {kind}, {rows} rows of {len(self.columns)} columns)")

    @property
    def kind(self) -> RunKind:
        """The kind of the run. DataError when the metadata name none, or one that this version does not know."""
        kind = self.text("kind")
        try:
            return RunKind(kind)
        except ValueError:
            raise DataError("unknown kind of run", where=self.path, value=kind, cure="update smadrive") from None

    @property
    def ended_by(self) -> str:
        """The cause of the run's early end. Empty for a complete run, and for a log without `end_time`."""
        causes = [event.message for event in self.events if event.message.startswith(ENDED_BY)]
        return causes[-1].removeprefix(ENDED_BY) if causes else ""

    @property
    def is_ended_by_user(self) -> bool:
        """True if a signal or `smadrive off` has ended the run."""
        return self.ended_by.startswith((INTERRUPTION, STOP))

    @property
    def is_tripped(self) -> bool:
        """True if a trip has ended the run."""
        return self.ended_by.startswith(TripError.__name__)

    @property
    def caveats(self) -> tuple[str, ...]:
        """Reasons to distrust the content: none if the log has checksums."""
        if self.has_checksums:
            return ()
        return (f"{self.path.name} has no checksums (smadrive {self.version} wrote none): damage would not be noticed",)

    @property
    def tripped_rows(self) -> NDArray[np.bool_]:
        """True for each row whose measurement tripped. Logs of older versions do not hold these measurements."""
        return self.columns.get("tripped", np.zeros_like(self.columns["time_s"])) > 0.0

    def without_trips(self) -> Log:
        """Return this log without the rows whose measurement tripped."""
        return self.rows(~self.tripped_rows)

    def rows(self, kept: NDArray[np.bool_]) -> Log:
        """Return this log with the rows for which `kept` (rows,) is True."""
        return replace(self, columns={name: values[kept] for name, values in self.columns.items()})

    def column_with_gaps(self, name: str) -> FloatArray:
        """Return the named column, with NaN where nothing was measured. DataError when the log has no such column."""
        if name not in self.columns:
            raise DataError(f"no column '{name}'", where=self.path, cure=suggestion_or_list(name, self.columns))
        return self.columns[name]

    def column(self, name: str) -> FloatArray:
        """Return the named column. DataError when a value is not finite, or when the log has no such column."""
        values = self.column_with_gaps(name)
        if not np.all(np.isfinite(values)):
            row = int(np.flatnonzero(~np.isfinite(values))[0])
            where = f"{self.path}, sample {row + 1}, column '{name}'"
            raise DataError("not a finite number", where=where, value=values[row], cure="record the run again")
        return values

    def text(self, name: str) -> str:
        """Return the text `name` of the metadata. DataError when the log has no such text."""
        if name not in self.metadata:
            raise DataError(
                f"the metadata lack '{name}'",
                where=self.path,
                cure="give a log of the right command (`excite` or `run`), recorded with this version of smadrive",
            )
        return self.metadata[name]

    def json(self, name: str) -> Any:
        """Return the JSON value `name` of the metadata. DataError when it is missing, or is not JSON."""
        return self.parsed(name, lambda value: value)

    def parsed(self, name: str, make: Callable[[Any], ValueT]) -> ValueT:
        """Return `make(value)` for the JSON value `name` of the metadata. DataError if it is missing or invalid."""
        text = self.text(name)
        try:
            return make(json.loads(text))
        except SmadriveError:
            raise
        except (ValueError, TypeError, KeyError, IndexError, AttributeError, OverflowError, RecursionError) as error:
            where = f"{self.path}: {name}"
            raise DataError("invalid metadata", where=where, value=_first_line(error), cure=RESTORE) from None


def read_log(path: Path) -> Log:
    """Return the log at `path`.

    DataError when the file is missing, damaged or not a log, refers to other files, or is from a later smadrive.
    """
    check_kind(path, LOG)
    try:
        with h5py.File(path, "r", locking=False) as file:
            content = read_content(file, path.stat().st_size)
    except FileNotFoundError:
        raise DataError("no such file", where=path, cure=missing_file_cure(path)) from None
    except ForeignContentError as error:
        raise DataError(f"not a log as smadrive writes it: {error}", where=path, cure=LOG.cure) from None
    except NewerLayoutError as error:
        what = "a later version of smadrive wrote this log"
        raise DataError(what, where=path, value=str(error), limit=LAYOUT, cure=CONVERT) from None
    except DamageError as error:
        where = f"{path}, {error.place}" if error.place else path
        raise DataError(f"damaged: {error}", where=where, cure=f"{RESTORE}, or {LOG.cure}") from None
    except Exception as error:  # noqa: BLE001 - a damaged file makes h5py raise errors of every kind
        raise _unreadable(path, error) from None
    return _log(path, content)


def _log(path: Path, content: Content) -> Log:
    times_s = content.columns["time_s"]
    backwards = np.flatnonzero(~(np.diff(times_s) > 0.0))
    if backwards.size:
        row = int(backwards[0])
        value = f"{times_s[row]:g} s, then {times_s[row + 1]:g} s"
        raise DataError("the time does not increase", where=f"{path}, sample {row + 2}", value=value, cure=RESTORE)
    events = tuple(RunEvent(time_s, text) for time_s, text in content.events)
    return Log(path, **{**content._asdict(), "events": events})


def _unreadable(path: Path, error: Exception) -> DataError:
    if not h5py.is_hdf5(path):
        return DataError("not a readable log of smadrive", where=path, cure=LOG.cure)
    if sizes := _CUT.search(str(error)):
        value = f"{sizes['found']} of {sizes['stored']} bytes"
        return DataError("the end of the log is missing", where=path, value=value, cure=COPY_AGAIN)
    what = f"not a readable log of smadrive, or damaged: {_first_line(error)}"
    return DataError(what, where=path, cure=f"{RESTORE}, or {LOG.cure}")


def _first_line(error: Exception) -> str:
    """Return the first line of the error's message, or the name of its type when the message is empty."""
    return (str(error).splitlines() or [type(error).__name__])[0]
