"""The counts of the publisher in shared memory: they survive a publisher process that dies and is restarted."""

from __future__ import annotations

from typing import NamedTuple, Self

import numpy as np

from smadrive.stream.mapped_block import MappedBlock, anonymous_memory

TROUBLE_BYTES = 240

LAYOUT = np.dtype(
    [
        ("confirmed_to", "i8"),  # all samples with a smaller number are confirmed, or dropped
        ("dropped", "i8"),
        ("connections", "i8"),
        ("is_ready", "i8"),  # see `Broker.is_ready`
        ("offs", "i8"),
        ("trouble", f"S{TROUBLE_BYTES}"),
    ]
)


class PublisherCounts(NamedTuple):
    """The counts of a publication, since the command began.

    samples        samples that the broker has confirmed
    dropped        samples that were overwritten before they were sent
    waiting        samples that are not confirmed yet
    connections    connections to the broker
    trouble        reason why the broker is not connected, or why `off` has no effect; empty before the first failure
    """

    samples: int
    dropped: int
    waiting: int
    connections: int
    trouble: str


class PublisherCounters(MappedBlock):
    """The counts of a publisher. The publisher process writes them, the driver reads them."""

    layout = LAYOUT

    @classmethod
    def created(cls) -> Self:
        """Create the memory, and return its counters. They are a context manager, which closes `memory_fd`."""
        return cls(anonymous_memory(LAYOUT.itemsize))

    def __getitem__(self, name: str) -> int:
        return self._count(name)

    def __setitem__(self, name: str, value: int) -> None:
        self._block[name] = value

    @property
    def trouble(self) -> str:
        """The reason why the broker is not connected, or why `off` has no effect. Empty before the first failure."""
        return bytes(self._block["trouble"][0]).decode(errors="replace")

    @trouble.setter
    def trouble(self, text: str) -> None:
        self._block["trouble"] = text.encode()[:TROUBLE_BYTES]

    def counts(self, written: int) -> PublisherCounts:
        """Return the counts after the driver has written this number of samples."""
        confirmed, dropped = self["confirmed_to"], self["dropped"]
        return PublisherCounts(confirmed - dropped, dropped, written - confirmed, self["connections"], self.trouble)
