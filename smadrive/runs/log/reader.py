"""What a run's log says: the columns of a tick, what was run, and what happened, read back into memory.

A log is readable at every moment of its life (see logfile.py): that of a run that still goes on or whose writer was
killed ends with its last complete row. What was read is proved by the log's checksums.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import h5py
import numpy as np
from numpy.typing import NDArray

from smadrive.errors import DataError, SmadriveError
from smadrive.files.kinds import LOG, check_kind
from smadrive.files.spelling import suggestion_or_list
from smadrive.runs.log.content import Content, read_content
from smadrive.runs.log.self_contained import ForeignContentError

Array = NDArray[np.float64]
ValueT = TypeVar("ValueT")

ENDED_BY = "ended by "
"""How the event begins that tells what ended a run before its time."""

RESTORE = "restore the log from a copy, or record it again"


class Event(NamedTuple):
    """Something that happened at `time_s`."""

    time_s: float
    message: str


@dataclass(frozen=True)
class Log:
    """The content of a log file. `about` are texts that tell what was recorded; `end_time` is empty when nobody ended
    the log: its writer was killed, or still writes. `is_checked`: checksums prove the content.
    """

    path: Path
    columns: Mapping[str, Array]
    about: Mapping[str, str]
    events: tuple[Event, ...]
    start_time: str
    end_time: str
    version: str
    is_checked: bool = True

    @property
    def ended_by(self) -> str:
        """What ended the run before its time; empty when nothing did."""
        causes = [event.message for event in self.events if event.message.startswith(ENDED_BY)]
        return causes[-1].removeprefix(ENDED_BY) if causes else ""

    @property
    def caveats(self) -> tuple[str, ...]:
        """Reasons to distrust the content."""
        if self.is_checked:
            return ()
        return (f"{self.path.name} has no checksums (smadrive {self.version} wrote none): damage would not be seen",)

    def signal(self, name: str) -> Array:
        """The named column, NaN where nothing was measured; DataError when there is none."""
        if name not in self.columns:
            raise DataError(f"{self.path}: no column '{name}'; {suggestion_or_list(name, self.columns)}")
        return self.columns[name]

    def column(self, name: str) -> Array:
        """The named column; DataError when there is none, or when it holds a value that is not finite."""
        values = self.signal(name)
        if not np.all(np.isfinite(values)):
            row = int(np.flatnonzero(~np.isfinite(values))[0])
            raise DataError(f"{self.path}, sample {row + 1}, column '{name}': not a finite number: record it again")
        return values

    def text(self, name: str) -> str:
        """What `about` tells of `name`; DataError when it tells nothing."""
        if name not in self.about:
            raise DataError(f"{self.path}: the log does not tell its {name}: record it with this version of smadrive")
        return self.about[name]

    def json(self, name: str) -> Any:
        """What `about` tells of `name`, as the JSON it is; DataError when it tells nothing, or is no JSON."""
        return self.parsed(name, lambda value: value)

    def parsed(self, name: str, make: Callable[[Any], ValueT]) -> ValueT:
        """What `make` makes of the JSON that `about` tells of `name`; DataError when it cannot be made of it."""
        text = self.text(name)
        try:
            return make(json.loads(text))
        except SmadriveError:
            raise
        except (ValueError, TypeError, KeyError, IndexError, AttributeError, OverflowError, RecursionError) as error:
            raise DataError(f"{self.path}: {name}: cannot be understood ({_said(error)}): {RESTORE}") from None


def read_log(path: Path) -> Log:
    """The log at `path`; DataError when it is missing, no log, damaged, or refers to other files."""
    check_kind(path, LOG)
    if not path.exists():
        raise DataError(f"{path}: no such file")
    try:
        with h5py.File(path, "r", locking=False) as file:
            content = read_content(file, path.stat().st_size)
    except ForeignContentError as error:
        raise DataError(f"{path}: not a log of smadrive alone: {error}. {LOG.cure.capitalize()}") from None
    except Exception as error:  # noqa: BLE001 - a damaged file makes h5py raise errors of every kind
        raise DataError(_unreadable(path, error)) from None
    return _log(path, content)


def _log(path: Path, content: Content) -> Log:
    columns = content.columns
    backwards = np.flatnonzero(~(np.diff(columns["time_s"]) > 0.0))
    if backwards.size:
        row = int(backwards[0])
        before_s, after_s = columns["time_s"][row : row + 2]
        raise DataError(f"{path}, sample {row + 2}: time goes from {before_s:g} s to {after_s:g} s: {RESTORE}")
    events = tuple(Event(time_s, text) for time_s, text in content.events)
    return Log(
        path,
        columns,
        content.about,
        events,
        content.start_time,
        content.end_time,
        content.version,
        content.is_checked,
    )


def _unreadable(path: Path, error: Exception) -> str:
    if not h5py.is_hdf5(path):
        return f"{path}: not a readable log of smadrive: {LOG.cure}"
    return f"{path}: not a readable log of smadrive, or damaged ({_said(error)}): {RESTORE}, or {LOG.cure}"


def _said(error: Exception) -> str:
    """The first line of a message, or the error's type where it says nothing."""
    return (str(error).splitlines() or [type(error).__name__])[0]
