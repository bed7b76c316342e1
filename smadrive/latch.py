"""What ended the last run, kept until somebody clears it: a tripped rig refuses to heat, also after a new start.

A board latches its own faults. What only the driver noticed, and every fault on a supply, would be forgotten with the
process; so it is written down, one file for each address of a heat source, in the user's folder for state.
"""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path
from urllib.parse import quote

from smadrive.errors import DataError, TripError
from smadrive.outfile import replacing


def state_dir() -> Path:
    """`$XDG_STATE_HOME/smadrive`, in `~/.local/state` without that variable."""
    return Path(os.environ.get("XDG_STATE_HOME") or Path.home() / ".local" / "state") / "smadrive"


class TripLatch:
    """The trip of one heat source; without an `address` (a simulated one) it lasts as long as the process."""

    def __init__(self, address: str | None) -> None:
        self._told: str | None = None
        self._file = None if address is None else state_dir() / f"{quote(address, safe='')}.tripped"

    @property
    def told(self) -> str | None:
        """What tripped, its cause and its remedy; None when nothing is latched. A file that cannot be read counts."""
        if self._told is None and self._file is not None:
            try:
                self._told = self._file.read_text(encoding="utf-8").strip()
            except FileNotFoundError:
                return None
            except (OSError, UnicodeDecodeError) as error:
                return f"{self._file} cannot be read ({error})"
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
        """Forget it."""
        self._told = None
        if self._file is not None:
            with suppress(FileNotFoundError):
                self._file.unlink()
