"""A flight: the wire tracks a reference, and each tick of the reference is kept for `collect`."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator

from smadrive.bluesky.readings import WireSample
from smadrive.control.loop import Tick
from smadrive.control.references.reference import Reference
from smadrive.scripting.servo import Servo


class Flight:
    """The approach to a reference and its tracking by `servo`, both of which begin now.

    approach    the motion to the beginning of the reference; it yields no samples
    flown       the motion along the reference
    """

    def __init__(self, servo: Servo, reference: Reference) -> None:
        self._servo = servo
        self._samples: deque[WireSample] = deque()
        self.approach, self.flown = servo.follow(reference, self._take)

    def samples(self) -> Iterator[WireSample]:
        """Yield the sample of each tick of the reference since the last call."""
        while self._samples:
            yield self._samples.popleft()

    def _take(self, tick: Tick) -> None:
        self._samples.append(WireSample(tick, self._servo.unix_s(tick)))
