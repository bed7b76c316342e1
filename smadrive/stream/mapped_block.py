"""A record of numbers in shared memory.

The memory has no name: the processes inherit its file descriptor, so nothing is left behind when a process is killed.
"""

from __future__ import annotations

import mmap
import os
import tempfile
from types import TracebackType
from typing import ClassVar, Self

import numpy as np


class MappedBlock:
    """The memory behind the file descriptor `memory_fd`, as one record of type `layout`; a context manager."""

    layout: ClassVar[np.dtype[np.void]]

    def __init__(self, memory_fd: int) -> None:
        self.memory_fd = memory_fd
        self._block = np.frombuffer(mmap.mmap(memory_fd, self.layout.itemsize), self.layout)

    def __enter__(self) -> Self:
        """Return this block."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close the descriptor; mapped memory stays usable."""
        os.close(self.memory_fd)

    def _count(self, name: str) -> int:
        return int(self._block[name][0])

    def _increase(self, name: str) -> None:
        self._block[name][0] += 1


def anonymous_memory(size: int) -> int:
    """Create shared memory without a name, and return its file descriptor."""
    if hasattr(os, "memfd_create"):
        memory_fd = os.memfd_create("smadrive")
    else:
        with tempfile.TemporaryFile() as file:
            memory_fd = os.dup(file.fileno())
    os.truncate(memory_fd, size)
    return memory_fd
