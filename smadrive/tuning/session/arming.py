"""The request to arm, which waits until no change is queued or being built, and then gets one answer."""

from __future__ import annotations

from smadrive.tuning.link.requests import Arm
from smadrive.tuning.session.state import SessionState

MAX_WAIT_S = 2.0
"""An Arm that waits longer is refused: the wire must not heat when the user does not expect it any more."""


class Arming:
    """Keeps the request to arm while it waits. At most one request waits."""

    def __init__(self, state: SessionState) -> None:
        self._state = state

    @property
    def is_waiting(self) -> bool:
        """True if a request to arm waits for its answer."""
        return self._state.arm_request is not None

    def begin(self, request: Arm) -> None:
        """Keep a request to arm until `settle` answers it."""
        self._state.arm_request, self._state.arm_requested_s = request, self._state.now_s

    def settle(self, refused: str | None) -> None:
        """Answer the request that waits, if there is one. `refused` is the reason, or None when the heater is on."""
        request, self._state.arm_request = self._state.arm_request, None
        self._state.answer(request, refused)

    def expire(self) -> None:
        """Refuse the request if it has waited too long."""
        if self.is_waiting and self._state.now_s - self._state.arm_requested_s > MAX_WAIT_S:
            self.settle("a change was still being built: press Arm again")
