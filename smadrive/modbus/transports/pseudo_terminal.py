"""A pseudo-terminal: a serial port without hardware, such as a simulated device has.

After the end of a pseudo-terminal, another pseudo-terminal soon gets its number, and may be the terminal of a user. A
link that was left over then leads to the wrong terminal. So neither a path nor a link proves that the pseudo-terminal
still exists.
"""

from __future__ import annotations

import os
import weakref
from contextlib import suppress
from pathlib import Path
from typing import Self

TERMINALS = "/dev/pts/"

MOST_LINKS = 40
"""Largest number of links that Linux follows from one path."""


class PseudoTerminal:
    """The pseudo-terminal to which a path led when this object was made.

    Its `descriptor` neither reads nor writes, and keeps nothing open.
    """

    def __init__(self, path: str, descriptor: int) -> None:
        self._path = path
        self._links = _links(path)
        self._descriptor = descriptor
        self._close = weakref.finalize(self, os.close, descriptor)

    @classmethod
    def at(cls, path: str) -> Self | None:
        """Return the pseudo-terminal to which `path` leads; None if there is no port or a port of another kind."""
        if os.path.realpath(path).startswith(TERMINALS):
            with suppress(OSError):
                return cls(path, os.open(path, os.O_PATH | os.O_CLOEXEC))
        return None

    def close(self) -> None:
        """Close the descriptor. Afterwards do not use this object any more."""
        self._close()

    @property
    def exists(self) -> bool:
        """True if the pseudo-terminal has not ended.

        The link count of its file proves this. The times of the file also change with its owner or permissions.
        """
        return os.fstat(self._descriptor).st_nlink > 0

    @property
    def is_left_over(self) -> bool:
        """True if the pseudo-terminal has ended, and its path has the same links as when this object was made."""
        return not self.exists and _links(self._path) == self._links

    def is_at(self, path: str) -> bool:
        """Return True if this pseudo-terminal still exists and `path` leads to it."""
        with suppress(OSError):
            return self.exists and os.path.samestat(Path(path).stat(), os.fstat(self._descriptor))
        return False


def _links(path: str) -> tuple[tuple[int, int, int], ...]:
    """Return device, inode and time of the last change of every link from `path` to the port."""
    found: list[tuple[int, int, int]] = []
    step = Path(path)
    with suppress(OSError):
        while step.is_symlink() and len(found) < MOST_LINKS:
            link = step.lstat()
            found.append((link.st_dev, link.st_ino, link.st_ctime_ns))
            step = step.parent / step.readlink()
    return tuple(found)
