"""What a run's log says: the columns of a tick, and reading them back."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np
from numpy.typing import NDArray

from smadrive.configfile import nearest
from smadrive.errors import DataError

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Log:
    """The columns and attributes of a log file, in memory."""

    path: Path
    columns: Mapping[str, Array]
    attributes: Mapping[str, str]
    events: tuple[str, ...]

    def column(self, name: str) -> Array:
        """The named column; DataError when there is none, or when it holds a value that is not finite."""
        if name not in self.columns:
            raise DataError(f"{self.path}: no column '{name}'" + nearest(name, self.columns))
        values = self.columns[name]
        if not np.all(np.isfinite(values)):
            row = int(np.flatnonzero(~np.isfinite(values))[0])
            raise DataError(f"{self.path}, sample {row + 1}, column '{name}': not a finite number: record it again")
        return values

    def json_attribute(self, name: str) -> dict[str, float]:
        """The attribute `name` as the JSON object it is; DataError when the log has none."""
        if name not in self.attributes:
            raise DataError(f"{self.path}: the log does not tell its {name}: record it with `smadrive excite`")
        return dict(json.loads(self.attributes[name]))


def is_log(path: Path) -> bool:
    """Whether the name is that of a log (rather than of a CSV)."""
    return path.suffix in {".h5", ".hdf5", ".nxs"}


def read_log(path: Path) -> Log:
    """The log at `path`; DataError when it is missing or no HDF5 file."""
    if not path.is_file():
        raise DataError(f"{path}: no such file")
    try:
        with h5py.File(path, "r", libver="latest", swmr=True) as file:  # also one whose writer was killed
            columns = {name: np.asarray(data, dtype=np.float64) for name, data in file.items() if name != "events"}
            attributes = {name: str(value) for name, value in file.attrs.items()}
            events = tuple(event.decode() for event in file["events"][:]) if "events" in file else ()
    except OSError as error:
        raise DataError(f"{path}: not a readable HDF5 log ({error})") from None
    return Log(path, columns, attributes, events)
