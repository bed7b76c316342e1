"""A wire that changes while it works: its transformation moves in temperature, and its stroke fades.

    displacement = (1 - fade) · stroke · ξ          ξ: austenite fraction at the temperature T - shift

The temperature shift (K) and the fade of the stroke (a fraction) change linearly over a given time. Cycles under load
age a real wire in this way (functional fatigue). The driver's model then no longer fits the wire.
"""

from __future__ import annotations

from collections.abc import Callable

from firmware_sim.fault_parameters import Fraction, Positive
from firmware_sim.physics.ramp import Ramp


class Ageing:
    """The present ageing of the wire: the shift `shift_c` in K, and the fraction `fade` of the stroke that is lost."""

    def __init__(self) -> None:
        self.shift_c = 0.0
        self.fade = 0.0
        self._shift_c, self._fade = Ramp(0.0), Ramp(0.0)

    def age_wire(self, shift_c: float, over_s: Positive, fade: Fraction = 0.0) -> None:
        """Change the shift to `shift_c` (K) and the fade to `fade` (0 to 1), both linearly within `over_s`."""
        self._shift_c.begin(shift_c, over_s)
        self._fade.begin(fade, over_s)

    def advance(self, dt_s: float) -> None:
        """Let `dt_s` pass."""
        if self._shift_c.is_changing:
            self._shift_c.advance(dt_s)
            self._fade.advance(dt_s)
            self.shift_c, self.fade = self._shift_c.value, self._fade.value

    def by_name(self) -> dict[str, Callable[..., None]]:
        """Return the methods that a fault script can call, by name: only `age_wire`."""
        return {"age_wire": self.age_wire}
