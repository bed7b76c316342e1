"""The wire while no loop runs: measured at zero current, its heater made safe again until that is confirmed.

Not yet tried is not failed: that the heater could not be confirmed off is told only after it was tried.
"""

from __future__ import annotations

from math import inf

from smadrive.errors import SmadriveError
from smadrive.measurement import Measurement
from smadrive.rig.rig import Rig
from smadrive.tuning.session.status import Status

RETRY_S = 1.0
"""How often an unconfirmed safe state is tried again."""


class Idle:
    """Samples `rig`, and tells `status` what becomes of it."""

    def __init__(self, rig: Rig, status: Status) -> None:
        self._rig = rig
        self._status = status
        self._due_s = inf

    def make_safe(self) -> None:
        """Have the safe state tried at the next sample."""
        self._due_s = -inf

    def sample(self, now_s: float) -> Measurement | None:
        """One measurement at zero current; None while the devices do not answer."""
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
        self._status.tell(now_s, "heater off, confirmed")
