"""The surroundings of the wire: their temperature, and the heat that the wire loses to them.

    heat flow = factor · h A · (T - T_amb)

A draft multiplies the convection of still air, h A, by a factor. The ambient temperature T_amb may drift.
"""

from __future__ import annotations

from collections.abc import Callable
from math import inf

from firmware_sim.fault_parameters import Positive, Seconds
from firmware_sim.physics.ramp import Ramp


class Surroundings:
    """The air around the wire. `ambient_c` and `loss_w_per_k` are the present ambient temperature and heat loss."""

    def __init__(self, ambient_c: float, still_air_w_per_k: float) -> None:
        self.ambient_c, self.loss_w_per_k = ambient_c, still_air_w_per_k
        self._still_air_w_per_k = still_air_w_per_k
        self._ambient_c, self._factor = Ramp(ambient_c), Ramp(1.0)
        self._draft_left_s, self._ramp_s = inf, 0.0

    def draft(self, factor: Positive, for_s: Seconds, ramp_s: Positive = 1.0) -> None:
        """Multiply the convection of still air by `factor`.

        The draft reaches `factor` after `ramp_s`. After `for_s` it ceases, within `ramp_s` again.
        """
        self._factor.begin(factor, ramp_s)
        self._draft_left_s, self._ramp_s = for_s, ramp_s

    def drift_ambient(self, kelvin: float, over_s: Positive) -> None:
        """Change the ambient temperature by `kelvin`, linearly within `over_s`."""
        self._ambient_c.begin(self.ambient_c + kelvin, over_s)

    def advance(self, dt_s: float) -> None:
        """Let `dt_s` pass."""
        if self._factor.is_changing:
            self._factor.advance(dt_s)
            self.loss_w_per_k = self._factor.value * self._still_air_w_per_k
        if self._draft_left_s < inf:
            self._draft_left_s -= dt_s
            if self._draft_left_s < 1e-9:
                self._factor.begin(1.0, self._ramp_s)
                self._draft_left_s = inf
        if self._ambient_c.is_changing:
            self._ambient_c.advance(dt_s)
            self.ambient_c = self._ambient_c.value

    def by_name(self) -> dict[str, Callable[..., None]]:
        """Return the methods that a fault script can call, by name."""
        return {"draft": self.draft, "drift_ambient": self.drift_ambient}
