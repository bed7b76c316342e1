"""Which displacements a wire can have at a temperature: those between its branches, and nothing else.

    y_low(T) = y₊(T - δ) - m        y_high(T) = y₋(T + δ) + m        y₊, y₋ the branches of the major loop

with δ for a bead that is not quite as warm as the wire and m for a model that has aged. A sensor that is stuck, scaled
in another unit, or has lost its zero leaves the band as soon as the wire goes through its loop, and so does a wire that
is blocked or slack. Nothing else tells: a driver that believes such a sensor heats as far as its limits allow.
"""

from __future__ import annotations

import numpy as np

from smadrive.hysteresis import HysteresisModel
from smadrive.polyline import Polyline

UNSURE_C = 10.0
"""By how much the wire's temperature may differ from the reading, K."""

MARGIN = 0.1
"""By how much a wire may leave the loop of its model, in strokes of it."""

POINTS = 400
"""Of each branch."""


class PlausibleDisplacement:
    """The band above for the wire of `model`, whose thermocouple lags by `lag_s`."""

    def __init__(self, model: HysteresisModel, lag_s: float) -> None:
        warming_c = np.linspace(*model.input_range, POINTS)
        loop_mm = model.simulate(np.concatenate([warming_c, warming_c[::-1]]))
        self._branches = [Polyline(warming_c, branch) for branch in (loop_mm[:POINTS], loop_mm[POINTS:][::-1])]
        self._margin_mm = MARGIN * float(np.ptp(loop_mm))
        self.lag_s = lag_s

    def band_mm(self, temperature_c: float) -> tuple[float, float]:
        """The least and the greatest displacement at a reading of `temperature_c`."""
        ends = [
            branch.at(at_c)
            for branch in self._branches
            for at_c in (temperature_c - UNSURE_C, temperature_c + UNSURE_C)
        ]
        return min(ends) - self._margin_mm, max(ends) + self._margin_mm

    def nearest_mm(self, temperature_c: float, displacement_mm: float) -> float:
        """What comes nearest to `displacement_mm` of all that a wire can have at just this temperature."""
        ends = [branch.at(temperature_c) for branch in self._branches]
        return min(max(displacement_mm, min(ends)), max(ends))
