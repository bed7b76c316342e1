"""The temperatures at which the branches of the hysteresis loop have a displacement.

At the displacement y, the temperature T of a wire without a changed load lies between the branches:

    T₋(y) ≤ T ≤ T₊(y)        T₊ the heating branch, T₋ the cooling branch, as functions of y
"""

from __future__ import annotations

import numpy as np

from smadrive.hysteresis import HysteresisModel
from smadrive.numerics.piecewise_linear import PiecewiseLinear

POINTS = 2000
"""Number of points in the table of a branch."""


class BranchTemperatures:
    """Looks up the temperatures of the branches of `model` over the displacement, °C.

    Beyond the ends of the travel they are the ends of the model's temperature range.
    """

    def __init__(self, model: HysteresisModel) -> None:
        warming_c = np.linspace(*model.input_range, POINTS)
        self._sense = 1.0 if model.scale > 0.0 else -1.0
        self._heating, self._cooling = (
            PiecewiseLinear(np.maximum.accumulate(self._sense * (model.offset + model.scale * branch)), warming_c)
            for branch in (model.branch(warming_c, rising=True), model.branch(warming_c, rising=False))
        )

    def heating_c(self, displacement_mm: float) -> float:
        """Return the temperature T₊ of the heating branch."""
        return self._heating.at(self._sense * displacement_mm)

    def cooling_c(self, displacement_mm: float) -> float:
        """Return the temperature T₋ of the cooling branch."""
        return self._cooling.at(self._sense * displacement_mm)

    def nearest_c(self, temperature_c: float, displacement_mm: float, margin_mm: float) -> float:
        """Return the temperature between the branches that is nearest to `temperature_c`.

        The displacement may be wrong by ± `margin_mm`.
        """
        toward_hot_mm = self._sense * margin_mm
        warmest_c = self.heating_c(displacement_mm + toward_hot_mm)
        return max(min(temperature_c, warmest_c), self.cooling_c(displacement_mm - toward_hot_mm))
