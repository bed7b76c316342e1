"""The duty file of a guardian, which names the guarded device.

The guardian locks the file (flock) as long as it lives, so that a device has only one guardian. If the driver has ended
and the guardian cannot confirm the device off, the guardian waits for the device, and the file contains the reason.
`smadrive probe` and `off` show the waiting guardians. A new driver or `off` that has confirmed the device off
writes a second file. This file relieves the guardian, which ends without using a port.
"""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from contextlib import suppress
from hashlib import sha256
from pathlib import Path
from typing import Self

from pydantic import BaseModel, ConfigDict, ValidationError

from smadrive.devices.state.folder import state_dir, unreadable
from smadrive.devices.state.key import DeviceKey
from smadrive.errors import DataError
from smadrive.files.kinds import check_regular
from smadrive.posix import fcntl

FREE_WITHIN_S = 5.0
"""Longest time in seconds until a relieved guardian has ended."""
LOOK_AGAIN_S = 0.05


class Duty(BaseModel):
    """The content of a duty file: the guardian's process id, the device, and the parts of the device's key.

    `waiting` is the reason why the guardian waits for the device; None as long as it does not wait.
    """

    model_config = ConfigDict(extra="ignore", frozen=True)

    pid: int
    device: str
    names: frozenset[str]
    unit_id: int | None
    serial_number: str | None
    type_id: str | None = None
    waiting: str | None = None

    @property
    def key(self) -> DeviceKey:
        """The key of the guarded device."""
        return DeviceKey(self.names, self.unit_id, self.serial_number, type_id=self.type_id)

    def __str__(self) -> str:
        return (
            f"a guardian (process {self.pid}) still waits for {self.device}, which may heat ({self.waiting}). Connect "
            f"the device again, or cut its supply and end the guardian (kill -9 {self.pid})"
        )


class HeldDuty:
    """The locked duty file of this process. The end of this context manager removes the file.

    If the state folder cannot be written, there is no file.
    """

    def __init__(self, device: str, key: DeviceKey, descriptor: int | None) -> None:
        self._duty = Duty(
            pid=os.getpid(),
            device=device,
            names=key.names,
            unit_id=key.unit_id,
            serial_number=key.serial_number,
            type_id=key.type_id,
        )
        self._file = _file(key)
        self._descriptor = descriptor
        self._write()

    @classmethod
    def take(cls, device: str, key: DeviceKey) -> Self | None:
        """Lock the duty file and return the duty; None if another guardian still has it after `FREE_WITHIN_S`."""
        give_up_s = time.monotonic() + FREE_WITHIN_S
        while (descriptor := _locked(_file(key))) is None:
            if time.monotonic() >= give_up_s:
                return None
            time.sleep(LOOK_AGAIN_S)
        return cls(device, key, descriptor if descriptor >= 0 else None)

    @property
    def relieved(self) -> bool:
        """True if a new driver or `off` has confirmed the device off since this guardian began to wait."""
        try:
            return self._duty.waiting is not None and _relief(self._file).exists()
        except OSError:  # the state folder cannot be read
            return False

    def wait(self, problem: str) -> None:
        """Write into the file that the driver has ended and the guardian waits. `problem` is the reason."""
        if self._duty.waiting is None:
            with suppress(OSError):
                _relief(self._file).unlink(missing_ok=True)
        if self._duty.waiting != problem:
            self._duty = self._duty.model_copy(update={"waiting": problem})
            self._write()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exception: object) -> None:
        if self._descriptor is not None:
            with suppress(OSError):
                _relief(self._file).unlink(missing_ok=True)
                self._file.unlink(missing_ok=True)
            os.close(self._descriptor)

    def _write(self) -> None:
        if self._descriptor is not None:
            with suppress(OSError):
                data = self._duty.model_dump_json().encode()
                os.pwrite(self._descriptor, data, 0)
                os.ftruncate(self._descriptor, len(data))


def waiting_duties() -> list[Duty]:
    """Return the duties of the guardians that wait for a device; SafetyError if the state folder cannot be read."""
    return [duty for _, duty in _waiting()]


def relieve(key: DeviceKey) -> None:
    """End the guardians that wait for the device with this key, which has been confirmed off.

    SafetyError when the state folder cannot be read.
    """
    for file, duty in _waiting():
        if duty.key.proves(key):
            with suppress(OSError):
                _relief(file).touch()
                _await_end(file)


def _waiting() -> Iterator[tuple[Path, Duty]]:
    for file in _files():
        with suppress(OSError, ValidationError, DataError):
            check_regular(file, DataError)
            duty = Duty.model_validate_json(file.read_bytes())
            if duty.waiting is not None and _is_held(file):
                yield file, duty


def _files() -> list[Path]:
    try:
        return sorted(file for file in (state_dir() / "guardians").iterdir() if file.suffix == ".json")
    except (FileNotFoundError, NotADirectoryError):  # no guardian has ever had a duty here
        return []
    except OSError as error:
        raise unreadable(error) from None


def _await_end(file: Path) -> None:
    give_up_s = time.monotonic() + FREE_WITHIN_S
    while _is_held(file) and time.monotonic() < give_up_s:
        time.sleep(LOOK_AGAIN_S)


def _file(key: DeviceKey) -> Path:
    telling = (sorted(key.names), key.unit_id) if key.serial_number is None else (key.type_id, key.serial_number)
    return state_dir() / "guardians" / f"{sha256(repr(telling).encode()).hexdigest()[:32]}.json"


def _relief(file: Path) -> Path:
    return file.with_suffix(".off")


def _is_held(file: Path) -> bool:
    try:
        descriptor = os.open(file, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
    except OSError:
        return False
    try:
        fcntl.flock(descriptor, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except OSError:
        return False
    finally:
        os.close(descriptor)
    return False


def _locked(file: Path) -> int | None:
    """Lock the file and return its descriptor.

    Return -1 if the file cannot be made or locked, and None if another process holds the lock.
    """
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        descriptor = os.open(file, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
    except OSError:
        return -1
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        if file.stat().st_ino == os.fstat(descriptor).st_ino:
            return descriptor
    except BlockingIOError:
        pass
    except FileNotFoundError:  # the previous guardian has just ended and removed its file
        pass
    except OSError:
        os.close(descriptor)
        return -1
    os.close(descriptor)
    return None
