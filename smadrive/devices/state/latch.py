"""The trip latch: a trip stays latched until the user clears it, even if the driver is started again.

A board latches its own faults. A fault that only the driver detects, and every fault of a supply, would be lost at the
end of the driver. So the driver writes the trip to a file in the user's state folder, with the key of the heat source
(key.py). A record that cannot be read counts as a trip of every device. `--clear-faults` removes the records that apply
to the device.

smadrive 0.1 named its records by the address in the rig file, `ADDRESS.tripped`. When a device is found at this
address, the record is moved to the key of this device.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from hashlib import sha256
from pathlib import Path
from typing import NamedTuple
from urllib.parse import quote

from pydantic import BaseModel, ConfigDict, ValidationError

from smadrive.devices.state.folder import state_dir, unreadable
from smadrive.devices.state.key import BY_ID, DeviceKey
from smadrive.errors import DataError, SafetyError, TripError
from smadrive.files.atomic import replacing
from smadrive.files.kinds import check_regular
from smadrive.modbus.transports.pseudo_terminal import TERMINALS

RECORDS = "trip-*.json"
LONGEST_OLD_NAME = 230


class _Record(BaseModel):
    """The content of a record: a trip, and the key of its device."""

    model_config = ConfigDict(extra="ignore", frozen=True)

    names: frozenset[str]
    unit_id: int | None
    serial_number: str | None
    trip: str

    @property
    def key(self) -> DeviceKey:
        return DeviceKey(self.names, self.unit_id, self.serial_number)


class _FoundRecord(NamedTuple):
    """The file and the trip of a record that applies to a device."""

    file: Path
    trip: str


class TripLatch:
    """The trip of the heat source with this key. Without a key (simulated device), the trip ends with the process."""

    def __init__(self, key: DeviceKey | None) -> None:
        self._key = key
        self._trip: str | None = None

    def read(self) -> str | None:
        """Return the latched trip, with cause and remedy; return None if no trip is latched."""
        if self._trip is None and self._key is not None:
            _take_over_old(self._key)
            self._trip = next((found.trip for found in _applying(self._key)), None)
        return self._trip

    def latch(self, trip: TripError) -> None:
        """Latch the trip. If its record cannot be written, the latch ends with the process; `trip` gets a note."""
        self._trip = trip.what
        if self._key is None:
            return
        try:
            _write(self._key, trip.what)
        except (OSError, DataError) as error:
            trip.add_note(f"the next start of the driver will not know this trip: {error}")

    def clear(self) -> None:
        """Remove every record that applies to this heat source; SafetyError if a record cannot be removed."""
        for found in _applying(self._key) if self._key is not None else ():
            try:
                found.file.unlink(missing_ok=True)
            except OSError as error:
                raise SafetyError(
                    "the trip is not cleared, because its record cannot be removed",
                    where=found.file,
                    value=error.strerror,
                    cure="remove the file by hand",
                ) from None
        self._trip = None


def _applying(key: DeviceKey) -> Iterator[_FoundRecord]:
    """Yield the records that apply to the device with this key."""
    try:
        files = sorted(file for file in state_dir().iterdir() if file.match(RECORDS))
    except FileNotFoundError:
        return
    except OSError as error:
        yield _FoundRecord(state_dir(), f"a trip of unknown cause: {unreadable(error)}")
        return
    for file in files:
        yield from _applying_in(file, key)
    yield from _old_records(key)


def _applying_in(file: Path, key: DeviceKey) -> Iterator[_FoundRecord]:
    """Yield the record in the file if it applies or cannot be read."""
    try:
        record = _Record.model_validate_json(_text(file))
    except FileNotFoundError:
        return
    except (OSError, UnicodeDecodeError, DataError, ValidationError) as error:
        yield _FoundRecord(file, _unreadable(file, error))
        return
    if record.key.applies_to(key):
        yield _FoundRecord(file, record.trip or f"a trip of unknown cause: {file} has no text")


def _write(key: DeviceKey, trip: str) -> None:
    record = _Record(names=key.names, unit_id=key.unit_id, serial_number=key.serial_number, trip=trip)
    file = state_dir() / RECORDS.replace("*", key.digest)
    file.parent.mkdir(parents=True, exist_ok=True)
    with replacing(file) as partial:
        partial.write_text(record.model_dump_json(indent=2) + "\n", encoding="utf-8")


def _take_over_old(key: DeviceKey) -> None:
    """Rename the records of smadrive 0.1 for this port to the key of the present device. After an error, keep them."""
    for file, trip in _old_records(key):
        with suppress(OSError, DataError):
            if file.is_file():
                _write(key, trip)
                file.unlink()


def _old_records(key: DeviceKey) -> Iterator[_FoundRecord]:
    for address in _old_addresses(key):
        file = state_dir() / f"{_old_name(address)}.tripped"
        try:
            if not _is_of_older_terminal(file, address):
                yield _FoundRecord(file, _text(file).strip() or f"a trip of unknown cause: {file} is empty")
        except FileNotFoundError:
            continue
        except (OSError, UnicodeDecodeError, DataError) as error:
            yield _FoundRecord(file, _unreadable(file, error))


def _old_addresses(key: DeviceKey) -> Iterator[str]:
    """Yield the names that smadrive 0.1 may have given to a device at this port, without and with its unit id."""
    by_id = sorted(f"serial://{name}" for name in key.names if name.startswith(str(BY_ID)))
    for port in (*by_id, key.port):
        yield port
        if key.unit_id is not None:
            yield f"{port} unit {key.unit_id}"


def _is_of_older_terminal(file: Path, address: str) -> bool:
    """Return True if the record is older than the pseudo-terminal that has the number in `address` now."""
    path = Path(address.removeprefix("serial://").partition(" ")[0])
    return str(path).startswith(TERMINALS) and file.stat().st_mtime_ns < path.stat().st_ctime_ns


def _old_name(address: str) -> str:
    name = quote(address, safe="")
    if len(name) <= LONGEST_OLD_NAME:
        return name
    digest = sha256(address.encode()).hexdigest()
    return f"{name[: LONGEST_OLD_NAME - len(digest) - 1]}-{digest}"


def _text(file: Path) -> str:
    check_regular(file, DataError)
    return file.read_text(encoding="utf-8")


def _unreadable(file: Path, error: Exception) -> str:
    return f"a trip of unknown cause: {file} cannot be read ({error})"
