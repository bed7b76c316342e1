"""Measures the wire while no loop runs and the current is zero.

After `make_safe`, the safe state is written every `RETRY_S` until it is confirmed. `make_safe` does not change
`Status.is_safe`; a failed attempt to enter the safe state sets it to False, a confirmed one to True.
"""

from __future__ import annotations

from math import inf

from smadrive.errors import SmadriveError
from smadrive.measurement import Measurement
from smadrive.rig.rig import Rig
from smadrive.safety.shutdown import off_text
from smadrive.tuning.session.status import Status

RETRY_S = 1.0
"""The time between two attempts to enter the safe state."""


class Idle:
    """Measures with `rig`, and stores the error of a lost device and the result of a shutdown in `status`."""

    def __init__(self, rig: Rig, status: Status) -> None:
        self._rig = rig
        self._status = status
        self._due_s = inf

    def make_safe(self) -> None:
        """Enter the safe state at the next sample."""
        self._due_s = -inf

    def sample(self, now_s: float) -> Measurement | None:
        """Return one measurement at zero current; None if a device does not answer or the safe state is not confirmed.

        After `make_safe`, first enter the safe state.
        """
        try:
            if now_s > self._due_s:
                self._enter_safe_state(now_s)
            measurement = self._rig.measure()
        except SmadriveError as error:
            self._status.lost = str(error)
            return None
        self._status.lost = None
        return measurement

    def _enter_safe_state(self, now_s: float) -> None:
        self._due_s = now_s + RETRY_S
        try:
            self._rig.enter_safe_state()
        except SmadriveError:
            self._status.is_safe = False
            raise
        self._status.is_safe, self._due_s = True, inf
        self._status.add_event(now_s, off_text(confirmed=True))
