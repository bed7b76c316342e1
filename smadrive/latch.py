"""What ended the last run, kept until somebody clears it: a tripped rig refuses to heat, also after a new start.

A board latches its own faults. What only the driver noticed, and every fault on a supply, would be forgotten with the
process; so it is written down, one file for each address of a heat source, in the user's folder for state. Whatever
bears that name counts as a trip until it is gone, also when it tells nothing.
"""

from __future__ import annotations

import os
from hashlib import sha256
from pathlib import Path
from urllib.parse import quote

from smadrive.errors import DataError, SafetyError, TripError
from smadrive.filekind import check_regular
from smadrive.outfile import replacing

LONGEST_NAME = 230
"""Together with what it ends in, and that of its partial file, as long as a file's name may be: 255 bytes."""


def state_dir() -> Path:
    """`$XDG_STATE_HOME/smadrive`, in `~/.local/state` without that variable."""
    return Path(os.environ.get("XDG_STATE_HOME") or Path.home() / ".local" / "state") / "smadrive"


class TripLatch:
    """The trip of one heat source; without an `address` (a simulated one) it lasts as long as the process."""

    def __init__(self, address: str | None) -> None:
        self._told: str | None = None
        self._file = None if address is None else state_dir() / f"{_name(address)}.tripped"

    @property
    def told(self) -> str | None:
        """What tripped, its cause and its remedy; None when nothing is latched. A file that tells nothing counts."""
        if self._told is None and self._file is not None:
            try:
                self._told = _read(self._file)
            except FileNotFoundError:
                return None
            except (OSError, UnicodeDecodeError, DataError) as error:
                return f"a trip of unknown cause: {self._file} cannot be read ({error})"
        return self._told

    def latch(self, trip: TripError) -> None:
        """Keep the trip; one that cannot be written down says so, and lasts as long as the process."""
        self._told = str(trip)
        if self._file is None:
            return
        try:
            self._file.parent.mkdir(parents=True, exist_ok=True)
            with replacing(self._file) as partial:
                partial.write_text(f"{trip}\n", encoding="utf-8")
        except (OSError, DataError) as error:
            trip.add_note(f"the trip is not remembered by the next start: {error}")

    def clear(self) -> None:
        """Forget it; SafetyError when what tells of it cannot be removed."""
        if self._file is not None:
            try:
                self._file.unlink(missing_ok=True)
            except OSError as error:
                raise SafetyError(
                    f"not cleared: {self._file} cannot be removed ({error.strerror}): remove it by hand"
                ) from None
        self._told = None


def _name(address: str) -> str:
    """The address as the name of a file; one that is too long for that ends in its hash."""
    name = quote(address, safe="")
    if len(name) <= LONGEST_NAME:
        return name
    digest = sha256(address.encode()).hexdigest()
    return f"{name[: LONGEST_NAME - len(digest) - 1]}-{digest}"


def _read(file: Path) -> str:
    check_regular(file, DataError)
    return file.read_text(encoding="utf-8").strip() or f"a trip of unknown cause: {file} is empty"
