"""The request to arm. It waits until no change is queued or being built. It is answered once: heater on, or refused."""

from __future__ import annotations

from smadrive.tuning.link.requests import Arm
from smadrive.tuning.session.state import SessionState

MAX_WAIT_S = 2.0
"""A request to arm that waits longer is refused: after this time, the user does not expect the wire to heat."""


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
        """Answer the waiting request to arm, if any. `refused` is the reason for a refusal; None: the heater is on."""
        request, self._state.arm_request = self._state.arm_request, None
        self._state.answer(request, refused)

    def expire(self) -> None:
        """Refuse the request to arm if it has waited longer than `MAX_WAIT_S`."""
        if self.is_waiting and self._state.now_s - self._state.arm_requested_s > MAX_WAIT_S:
            self.settle("a change was still being built: press Arm again")
