"""What a run's log says: the columns of a tick, what was run, and what happened, read back into memory.

A log is readable at every moment of its life (see logfile.py): that of a run that still goes on or whose writer was
killed ends with its last complete row.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import h5py
import numpy as np
from numpy.typing import NDArray

from smadrive.errors import DataError
from smadrive.filekind import LOG, check_kind
from smadrive.nearest import nearest

Array = NDArray[np.float64]

ENDED_BY = "ended by "
"""How the event begins that tells what ended a run before its time."""


class Event(NamedTuple):
    """Something that happened at `time_s`."""

    time_s: float
    message: str


@dataclass(frozen=True)
class Log:
    """The content of a log file. `about` are texts that tell what was recorded; `end_time` is empty when nobody ended
    the log: its writer was killed, or still writes.
    """

    path: Path
    columns: Mapping[str, Array]
    about: Mapping[str, str]
    events: tuple[Event, ...]
    start_time: str
    end_time: str
    version: str

    @property
    def ended_by(self) -> str:
        """What ended the run before its time; empty when nothing did."""
        causes = [event.message for event in self.events if event.message.startswith(ENDED_BY)]
        return causes[-1].removeprefix(ENDED_BY) if causes else ""

    def column(self, name: str) -> Array:
        """The named column; DataError when there is none, or when it holds a value that is not finite."""
        if name not in self.columns:
            raise DataError(f"{self.path}: no column '{name}'" + nearest(name, self.columns))
        values = self.columns[name]
        if not np.all(np.isfinite(values)):
            row = int(np.flatnonzero(~np.isfinite(values))[0])
            raise DataError(f"{self.path}, sample {row + 1}, column '{name}': not a finite number: record it again")
        return values

    def json(self, name: str) -> Any:
        """What `about` tells of `name`, as the JSON it is; DataError when it tells nothing."""
        if name not in self.about:
            raise DataError(f"{self.path}: the log does not tell its {name}: record it with this version of smadrive")
        return json.loads(self.about[name])


def read_log(path: Path) -> Log:
    """The log at `path`; DataError when it is missing or no log."""
    check_kind(path, LOG)
    if not path.exists():
        raise DataError(f"{path}: no such file")
    try:
        with h5py.File(path, "r", locking=False) as file:
            return _read(path, file["entry"])
    except (OSError, KeyError, RuntimeError) as error:
        damage = f" ({error})" if h5py.is_hdf5(path) else ""
        raise DataError(f"{path}: not a readable log of smadrive{damage}: {LOG.cure}") from None


def _read(path: Path, entry: h5py.Group) -> Log:
    events = _written(entry["events"])
    messages = [message.rstrip(b"\0").decode(errors="ignore") for message in events["message"]]
    return Log(
        path,
        columns=_written(entry["data"]),
        about={name: text.asstr()[()] for name, text in entry["about"].items()},
        events=tuple(Event(float(time_s), text) for time_s, text in zip(events["time_s"], messages, strict=True)),
        start_time=entry["start_time"].asstr()[()],
        end_time=entry["end_time"][()].decode(),
        version=str(entry["program_name"].attrs["version"]),
    )


def _written(group: h5py.Group) -> dict[str, Array]:
    """The datasets of a group, up to the last row that was written completely: time is written last."""
    rows = int(np.count_nonzero(np.isfinite(group["time_s"][:])))
    return {name: values[:rows] for name, values in group.items()}
