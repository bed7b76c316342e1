"""The heat of the last run on a heat source, which outlives the driver.

A wire whose bead has come off reads the same cold temperature before each run. A script or a loop of commands that
opens the rig for every pulse of current would heat such a wire further with every pulse, while each supervisor knows
only its own run. So the possible wires at the end of a run (`Heated`) are written to a file in the user's state folder,
and the next run begins with them, in whatever process.

Only exactly the same key of the heat source finds the file: the wire on another one has not been heated by the last
run. The times are those of the machine's monotonic clock, which all processes share. A time in the future is one before
a restart of the machine. In virtual time, and without a key (simulated device), the heat is known in this process only.
"""

from __future__ import annotations

import time
from contextlib import suppress
from pathlib import Path

from pydantic import TypeAdapter, ValidationError

from smadrive.clock import Clock, MonotonicClock
from smadrive.devices.state.folder import state_dir
from smadrive.devices.state.key import DeviceKey
from smadrive.errors import DataError
from smadrive.files.atomic import replacing
from smadrive.files.kinds import check_regular
from smadrive.safety.temperature_band import Heated

RECORDS = "heat-*.json"
KEPT_S = 3600.0
"""Older records are removed, s. A wire is cold after this time."""

_HEATED = TypeAdapter(Heated)


class LastHeat:
    """The possible wires at the end of the last run on the heat source with this key."""

    def __init__(self, key: DeviceKey | None, clock: Clock) -> None:
        is_shared = key is not None and isinstance(clock, MonotonicClock)
        self._file = state_dir() / RECORDS.replace("*", key.digest) if key is not None and is_shared else None
        self._heated = None if self._file is None else _read(self._file, clock.now_s())

    def read(self) -> Heated | None:
        """Return the possible wires; None if no run is known."""
        return self._heated

    def keep(self, heated: Heated | None) -> None:
        """Keep the possible wires at the end of a run. Without a file that can be written, this process keeps them."""
        self._heated = heated
        if self._file is None or heated is None:
            return
        with suppress(OSError, DataError):
            self._file.parent.mkdir(parents=True, exist_ok=True)
            _remove_old(self._file.parent)
            with replacing(self._file) as partial:
                partial.write_bytes(_HEATED.dump_json(heated))


def _read(file: Path, now_s: float) -> Heated | None:
    """Return the content of the file; None without one, with a time after `now_s`, or if it cannot be read."""
    try:
        check_regular(file, DataError)
        heated = _HEATED.validate_json(file.read_bytes())
    except (OSError, DataError, ValidationError):
        return None
    return heated if heated.time_s <= now_s else None


def _remove_old(folder: Path) -> None:
    for file in folder.glob(RECORDS):
        if time.time() - file.stat().st_mtime > KEPT_S:
            file.unlink(missing_ok=True)
