"""The bead of the thermocouple between the wire and the air.

The thermal conductance from the bead to the wire is c G, and from the bead to the air `AIR` G. The contact c is 1 for a
bead that is tight on the wire, and nearly 0 for a loose bead. The converter is calibrated with a tight bead. So the
reading approaches T_b with the time constant τ:

    T_b = T_amb + s (T - T_amb)          s = c (1 + AIR)/(c + AIR)          τ = lag · (1 + AIR)/(c + AIR)

T is the temperature of the wire, T_amb the temperature of the air, and `lag` the time constant of the tight bead. A
bead that comes off therefore becomes slower, and its reading falls towards the temperature of the air.
"""

from __future__ import annotations

from collections.abc import Callable
from math import exp

from firmware_sim.fault_parameters import Positive, Share
from firmware_sim.physics.ramp import Ramp

AIR = 0.05
"""Conductance from the bead to the air, divided by the conductance from a tight bead to the wire."""


class Bead:
    """The bead: its temperature, and its contact to the wire."""

    def __init__(self, temperature_c: float, lag_s: float) -> None:
        self.temperature_c = temperature_c
        self._contact = Ramp(1.0)
        self._tight_lag_s = self._lag_s = lag_s
        self._share = 1.0

    def loosen_bead(self, contact: Share, over_s: Positive) -> None:
        """Change the contact to `contact`, linearly within `over_s`; 1 is a tight bead."""
        self._contact.begin(contact, over_s)

    def advance(self, before_c: float, after_c: float, ambient_c: float, dt_s: float) -> None:
        """Let `dt_s` pass while the wire changes its temperature from `before_c` to `after_c`.

        The step is exact for a linear change of the wire temperature and a constant contact.
        """
        if self._contact.is_changing:
            self._loosen(dt_s)
        lag_s, start_c, end_c = self._lag_s, before_c, after_c
        if self._share < 1.0:
            start_c, end_c = (ambient_c + self._share * (wire_c - ambient_c) for wire_c in (before_c, after_c))
        if lag_s == 0.0:
            self.temperature_c = end_c
            return
        decay = exp(-dt_s / lag_s)
        steady_c = end_c - start_c - (end_c - start_c) * lag_s / dt_s * (1.0 - decay)
        self.temperature_c = start_c + steady_c + (self.temperature_c - start_c) * decay

    def _loosen(self, dt_s: float) -> None:
        self._contact.advance(dt_s)
        grip = (1.0 + AIR) / (self._contact.value + AIR)
        self._share, self._lag_s = self._contact.value * grip, self._tight_lag_s * grip

    def by_name(self) -> dict[str, Callable[..., None]]:
        """Return the methods that a fault script can call, by name: only `loosen_bead`."""
        return {"loosen_bead": self.loosen_bead}
