"""A change of the load on the wire while the simulation runs.

The stress moves the temperatures of both branches (see transformation.py). So a wire that gets a heavier load at a
constant temperature turns to martensite, as if it was cooled, and stretches. The elastic strain, some tenths of a
percent of the length, is left out.
"""

from __future__ import annotations

from collections.abc import Callable

from firmware_sim.fault_parameters import Positive
from firmware_sim.physics.ramp import Ramp


class Load:
    """The stress that `step_load` has added to the stress of the bias load up to now."""

    def __init__(self) -> None:
        self._added_mpa = Ramp(0.0)

    def step_load(self, mpa: float, over_s: Positive = 0.1) -> None:
        """Raise the stress by `mpa`, linearly within `over_s`; a negative number lowers it."""
        self._added_mpa.begin(self._added_mpa.value + mpa, over_s)

    def advance(self, dt_s: float) -> float:
        """Let `dt_s` pass. Return the change of the stress in this time, in MPa."""
        if not self._added_mpa.is_changing:
            return 0.0
        before_mpa = self._added_mpa.value
        self._added_mpa.advance(dt_s)
        return self._added_mpa.value - before_mpa

    def by_name(self) -> dict[str, Callable[..., None]]:
        """Return the methods that a fault script can call, by name: only `step_load`."""
        return {"step_load": self.step_load}
