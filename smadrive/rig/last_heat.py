"""The heat of the last run on a heat source, which outlives the driver.

A wire whose bead has come off reads the same cold temperature before each run. A script or a loop of commands that
opens the rig for every pulse of current would heat such a wire further with every pulse, while each supervisor knows
only its own run. So the possible wires at the end of a run (`Heated`) are written to a file in the user's state folder,
and the next run begins with them, in whatever process. A killed driver writes nothing.

The file holds the key of the heat source. One common name of the port shows that it is the same one, but a link to a
pseudo-terminal may lead to another simulated device: then all names must be the same. Times are those of the machine's
monotonic clock, which all processes share until the machine is started again. In virtual time, and without a key
(simulated device), the heat is known in this process only.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from pydantic import BaseModel, ConfigDict, ValidationError

from smadrive.clock import Clock, MonotonicClock
from smadrive.devices.state.folder import state_dir
from smadrive.devices.state.key import DeviceKey, Match
from smadrive.errors import DataError
from smadrive.files.atomic import replacing
from smadrive.files.kinds import check_regular
from smadrive.interrupts import HeldSignals, signals_obeyed_afterwards
from smadrive.modbus.transports.pseudo_terminal import TERMINALS
from smadrive.safety.temperature_band import Heated

RECORDS = "heat-*.json"
KEPT_S = 3600.0
"""Older records are ignored and removed, s. A wire is cold after this time."""
BOOT_ID = Path("/proc/sys/kernel/random/boot_id")
"""A text that Linux chooses at each start of the machine."""


class _Record(BaseModel):
    """The content of a file: the heat, the key of its heat source, and the start of the machine."""

    model_config = ConfigDict(extra="ignore", frozen=True, allow_inf_nan=False)

    names: frozenset[str]
    unit_id: int | None
    serial_number: str | None
    boot_id: str
    heated: Heated

    def is_of(self, key: DeviceKey, now_s: float) -> bool:
        """Return True if the last run was on the heat source with this key, before `now_s` on the present clock."""
        of_record = DeviceKey(self.names, self.unit_id, self.serial_number)
        is_terminal = any(name.startswith(TERMINALS) for name in self.names | key.names)
        is_same_port = of_record.port_match(key) is Match.SAME and (self.names == key.names or not is_terminal)
        is_same = is_same_port and of_record.serial_match(key) is not Match.DIFFERENT
        return is_same and self.boot_id == _boot_id() and now_s - KEPT_S < self.heated.time_s <= now_s


class LastHeat:
    """The possible wires at the end of the last run on the heat source with this key."""

    def __init__(self, key: DeviceKey | None, clock: Clock) -> None:
        self._key = key if isinstance(clock, MonotonicClock) else None
        self._heated = None if self._key is None else _found(self._key, clock.now_s())

    def read(self) -> Heated | None:
        """Return the possible wires; None if no run is known."""
        return self._heated

    @contextmanager
    def kept(self, heated: Callable[[], Heated | None]) -> Iterator[None]:
        """Keep `heated()` at the end of the `with` block. Only the third signal interrupts this (see HeldSignals).

        An error that ended the block is raised again, and the first two signals do not replace it.
        """
        try:
            yield
        except BaseException:
            with HeldSignals():
                self.keep(heated())
            raise
        with signals_obeyed_afterwards():
            self.keep(heated())

    def keep(self, heated: Heated | None) -> None:
        """Keep the possible wires at the end of a run. If no file can be written, only this process keeps them."""
        self._heated = heated
        if self._key is None or heated is None:
            return
        key, file = self._key, state_dir() / RECORDS.replace("*", self._key.digest)
        with suppress(OSError, DataError, ValidationError):
            record = _Record(
                names=key.names, unit_id=key.unit_id, serial_number=key.serial_number, boot_id=_boot_id(), heated=heated
            )
            file.parent.mkdir(parents=True, exist_ok=True)
            with replacing(file) as partial:
                partial.write_text(record.model_dump_json(), encoding="utf-8")
        _remove_old()


def _found(key: DeviceKey, now_s: float) -> Heated | None:
    """Return the latest heat of the records that apply; None without one. A record that cannot be read is ignored."""
    found = []
    for file in _files():
        with suppress(OSError, DataError, ValidationError):
            check_regular(file, DataError)
            record = _Record.model_validate_json(file.read_bytes())
            if record.is_of(key, now_s):
                found.append(record.heated)
    return max(found, key=lambda heated: heated.time_s, default=None)


def _remove_old() -> None:
    for file in _files():
        with suppress(OSError):
            if time.time() - file.stat().st_mtime > KEPT_S:
                file.unlink()


def _files() -> list[Path]:
    with suppress(OSError):
        return list(state_dir().glob(RECORDS))
    return []


def _boot_id() -> str:
    """Return the id of the present start of the machine; "" on a system without one."""
    with suppress(OSError):
        return BOOT_ID.read_text(encoding="ascii").strip()
    return ""
