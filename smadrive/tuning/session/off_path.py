"""Whether OFF on the tuning page has an effect: the front process that answers it beats in the channel."""

from __future__ import annotations

from math import inf

from smadrive.errors import FrontSilentError
from smadrive.tuning.link.channel import ControlEnd

SILENT_S = 2.0
"""A front process that died is back within this time; a frozen one is killed after 1 s."""


class OffPath:
    """Watches the beats of the front process. Without any beat so far it counts as silent."""

    def __init__(self, channel: ControlEnd) -> None:
        self._channel = channel
        self._beats = channel.front_beats
        self._beat_s = -inf

    def is_silent(self, now_s: float) -> bool:
        """Whether no beat has been seen for more than SILENT_S."""
        if self._channel.front_beats != self._beats:
            self._beats, self._beat_s = self._channel.front_beats, now_s
        return now_s - self._beat_s > SILENT_S


def front_silent() -> FrontSilentError:
    """The reason to switch off, or to refuse to arm."""
    return FrontSilentError(
        f"OFF of the tuning page: its front process has not answered for {SILENT_S:g} s. It is started again; arm then"
    )
