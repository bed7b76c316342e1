"""The counts of the publisher in shared memory: they survive a publisher process that dies and is restarted."""

from __future__ import annotations

import mmap
import os
from types import TracebackType
from typing import Self

import numpy as np

from smadrive.stream.shared_memory import anonymous_memory

TROUBLE_BYTES = 240

LAYOUT = np.dtype(
    [
        ("confirmed_to", "i8"),  # all samples with a smaller number are confirmed, or dropped
        ("dropped", "i8"),
        ("connections", "i8"),
        ("is_connected", "i8"),
        ("offs", "i8"),
        ("trouble", f"S{TROUBLE_BYTES}"),
    ]
)


class PublisherCounters:
    """The counts behind the file descriptor `memory_fd`. The publisher process writes, the control process reads."""

    def __init__(self, memory_fd: int) -> None:
        self.memory_fd = memory_fd
        self._values = np.frombuffer(mmap.mmap(memory_fd, LAYOUT.itemsize), LAYOUT)

    @classmethod
    def created(cls) -> Self:
        """Create the memory. The caller closes `memory_fd` by leaving the context."""
        return cls(anonymous_memory(LAYOUT.itemsize))

    def __enter__(self) -> Self:
        """Return the counts."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close the descriptor; mapped memory stays usable."""
        os.close(self.memory_fd)

    def __getitem__(self, name: str) -> int:
        return int(self._values[name][0])

    def __setitem__(self, name: str, value: int) -> None:
        self._values[name] = value

    @property
    def trouble(self) -> str:
        """The reason why the broker is not connected; empty before the first attempt, and while it is connected."""
        return bytes(self._values["trouble"][0]).decode(errors="replace")

    @trouble.setter
    def trouble(self, text: str) -> None:
        self._values["trouble"] = text.encode()[:TROUBLE_BYTES]
