"""The data of the page of `smadrive watch`: every measurement, and a status with faults and the end of the command."""

from __future__ import annotations

from smadrive.rig.rig import Rig
from smadrive.safety.shutdown import shut_down
from smadrive.stream.feed import TickFeed
from smadrive.stream.published_state import PublishedEnd, PublishedMode
from smadrive.tuning.link.channel import DriverEnd


class WatchFeed(TickFeed):
    """Sends the measurements of a rig, whose heater is off, to the pages through `channel`."""

    def __init__(self, rig: Rig, channel: DriverEnd) -> None:
        nothing = dict.fromkeys(("end", "lost", "fault", "fault_type", "fault_s"))
        latched = rig.latch.read()
        super().__init__(channel, rig.config, rig.identities, latched=latched, mode=PublishedMode.OFF, **nothing)
        self._rig = rig
        self._channel = channel
        self._publish()

    def off_requested(self) -> bool:
        """Return True if a program has sent `POST /off` since the last call.

        The page itself has no OFF button, because nothing heats.
        """
        return self._channel.off_requested()

    def end(self) -> None:
        """Enter the safe state once more, and report to the pages whether it is confirmed. The rig must be open."""
        outcome = shut_down(self._rig.heater.enter_safe_state)
        self._publish(end=PublishedEnd.switched_off(confirmed=outcome.confirmed))
