"""Checks that OFF on the tuning page has an effect: the front process, which answers OFF, must send heartbeats."""

from __future__ import annotations

from math import inf

from smadrive.errors import FrontSilentError
from smadrive.tuning.link.channel import DriverEnd

SILENT_S = 2.0
"""A front process counts as silent if its last heartbeat is older than this.

Normally, a front process that died is restarted within this time. A frozen front process is killed after 1 s.
"""


class OffPath:
    """Watches the heartbeats of the front process. Until the first new heartbeat, the process counts as silent."""

    def __init__(self, channel: DriverEnd) -> None:
        self._channel = channel
        self._beats = channel.front_beats
        self._beat_s = -inf

    def is_silent(self, now_s: float) -> bool:
        """Return True if no heartbeat came for more than `SILENT_S`. Call this at every tick, with the present time."""
        if self._channel.front_beats != self._beats:
            self._beats, self._beat_s = self._channel.front_beats, now_s
        return now_s - self._beat_s > SILENT_S


def front_silent() -> FrontSilentError:
    """Return the error for a silent front process. It ends the run of the loop, or refuses a request to arm."""
    return FrontSilentError(
        "the front process of the page does not answer",
        where="OFF of the tuning page",
        limit=f"{SILENT_S:g} s",
        cure="wait until the front process has been restarted, then arm",
    )
