"""The temperatures at which the branches of the hysteresis loop have a displacement.

At the displacement y, the temperature T of a wire without a changed load lies between the branches:

    T₋(y) ≤ T ≤ T₊(y)        T₊ the heating branch, T₋ the cooling branch, as functions of y

At the cold end of the travel the wire may have any lower temperature, and at the hot end any higher one.
"""

from __future__ import annotations

from math import inf

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
        heating, cooling = (
            np.maximum.accumulate(self._sense * (model.offset + model.scale * model.branch(warming_c, rising=rising)))
            for rising in (True, False)
        )
        self._heating, self._cooling = PiecewiseLinear(heating, warming_c), PiecewiseLinear(cooling, warming_c)
        self._cold, self._hot = float(cooling[0]), float(heating[-1])

    def heating_c(self, displacement_mm: float) -> float:
        """Return the temperature T₊ of the heating branch."""
        return self._heating.at(self._sense * displacement_mm)

    def cooling_c(self, displacement_mm: float) -> float:
        """Return the temperature T₋ of the cooling branch."""
        return self._cooling.at(self._sense * displacement_mm)

    def nearest_c(self, temperature_c: float, displacement_mm: float, margin_mm: float) -> float:
        """Return the temperature that is nearest to `temperature_c`, of those possible at the displacement.

        The displacement may be wrong by ± `margin_mm`. Beyond the travel, it counts as the end of the travel.
        """
        place = min(max(self._sense * displacement_mm, self._cold), self._hot)
        coldest_c = self._cooling.at(place - margin_mm) if place - margin_mm > self._cold else -inf
        warmest_c = self._heating.at(place + margin_mm) if place + margin_mm < self._hot else inf
        return max(min(temperature_c, warmest_c), coldest_c)
