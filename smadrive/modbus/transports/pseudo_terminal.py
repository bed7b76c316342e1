"""A pseudo-terminal: a serial port without hardware, such as a simulated device has.

The path of a pseudo-terminal is /dev/pts/NUMBER. Soon after its end, Linux gives its number to another pseudo-terminal,
such as the terminal window of a user. A symbolic link that was not removed then leads to the wrong terminal. So neither
a path nor a link proves that the pseudo-terminal still exists.
"""

from __future__ import annotations

import os
import weakref
from contextlib import suppress
from pathlib import Path
from typing import Self

TERMINALS = "/dev/pts/"

MOST_LINKS = 40
"""Largest number of symbolic links that Linux follows from one path."""


class PseudoTerminal:
    """The pseudo-terminal to which `path` led when this object was made.

    `descriptor` was opened with O_PATH. It only identifies the file of the pseudo-terminal: it cannot read or write,
    and does not keep the pseudo-terminal open.
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
        """Close the descriptor. Do not use this object afterwards."""
        self._close()

    @property
    def exists(self) -> bool:
        """True if the pseudo-terminal has not ended.

        The link count of the file in /dev/pts is 0 after the end. The times of the file prove nothing: they change with
        owner and permissions, too.
        """
        return os.fstat(self._descriptor).st_nlink > 0

    @property
    def is_left_over(self) -> bool:
        """True if the pseudo-terminal has ended, and its path still has the same symbolic links.

        Then no program has led the path to a new pseudo-terminal since this object was made.
        """
        return not self.exists and _links(self._path) == self._links

    def is_at(self, path: str) -> bool:
        """Return True if this pseudo-terminal still exists and `path` leads to it."""
        with suppress(OSError):
            return self.exists and os.path.samestat(Path(path).stat(), os.fstat(self._descriptor))
        return False


def _links(path: str) -> tuple[tuple[int, int, int], ...]:
    """Return device, inode and time of the last change (ns) of each symbolic link from `path` to the port."""
    found: list[tuple[int, int, int]] = []
    step = Path(path)
    with suppress(OSError):
        while step.is_symlink() and len(found) < MOST_LINKS:
            link = step.lstat()
            found.append((link.st_dev, link.st_ino, link.st_ctime_ns))
            step = step.parent / step.readlink()
    return tuple(found)
