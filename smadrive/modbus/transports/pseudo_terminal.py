"""A pseudo-terminal: a serial port without hardware, such as a simulated device has.

After the end of a pseudo-terminal, its number is soon given to another one, which may be the terminal of a user. So its
path does not prove that it still exists.
"""

from __future__ import annotations

import os
import weakref
from contextlib import suppress
from pathlib import Path
from typing import Self

TERMINALS = "/dev/pts/"


class PseudoTerminal:
    """The pseudo-terminal that was at a path once. Its descriptor neither reads nor writes, and keeps nothing open."""

    def __init__(self, descriptor: int) -> None:
        self._descriptor = descriptor
        self._close = weakref.finalize(self, os.close, descriptor)

    @classmethod
    def at(cls, path: str) -> Self | None:
        """Return the pseudo-terminal at `path`; None if `path` is a link, a port of another kind, or missing."""
        if path.startswith(TERMINALS):
            with suppress(OSError):
                return cls(os.open(path, os.O_PATH | os.O_CLOEXEC))
        return None

    def close(self) -> None:
        """Close the descriptor; afterwards nothing can be asked."""
        self._close()

    @property
    def exists(self) -> bool:
        """True if the pseudo-terminal has not ended.

        The link count of its file proves this. The times of the file also change with its owner or permissions.
        """
        return os.fstat(self._descriptor).st_nlink > 0

    def is_at(self, path: str) -> bool:
        """Return True if `path` leads to this pseudo-terminal, which exists."""
        with suppress(OSError):
            return self.exists and os.path.samestat(Path(path).stat(), os.fstat(self._descriptor))
        return False
