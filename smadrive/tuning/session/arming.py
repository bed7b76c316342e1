"""The request to arm: it waits until the wire is held, and gets one answer."""

from __future__ import annotations

from collections.abc import Callable

from smadrive.errors import ConfigError
from smadrive.tuning.link.messages import Arm, Request

LONGEST_S = 2.0
"""So long an Arm may wait for a change on its way into force: heat that nobody expects any more must not come."""


class Arming:
    """At most one request to arm; `answer(request, refused)` sends its answer, None as `refused` when it is done."""

    def __init__(self, answer: Callable[[Request, str | None], None]) -> None:
        self._answer = answer
        self._request: Arm | None = None
        self._asked_s = 0.0

    @property
    def waits(self) -> bool:
        """Whether a request has no answer yet."""
        return self._request is not None

    def begin(self, request: Arm, now_s: float) -> None:
        """Take a request; ConfigError while another one waits."""
        if self.waits:
            raise ConfigError("it is armed already")
        self._request, self._asked_s = request, now_s

    def settle(self, refused: str | None) -> None:
        """Answer the request that waits, if there is one."""
        if self._request is not None:
            self._answer(self._request, refused)
            self._request = None

    def expire(self, now_s: float) -> None:
        """Refuse the request that has waited for too long."""
        if self.waits and now_s - self._asked_s > LONGEST_S:
            self.settle("a change was still on its way into force: press again")
