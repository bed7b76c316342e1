"""The displacements that are possible at a temperature: between the branches of the model, with margins.

    y_low(T) = y₊(T - δ) - m        y_high(T) = y₋(T + δ) + m        y₊, y₋ the heating and the cooling branch

δ allows for a bead that is colder or warmer than the wire, m for a wire that has aged since its identification. The
check finds a sensor that is stuck, has a wrong unit or has lost its zero, and a wire that is blocked or slack. In these
cases the displacement leaves the band as soon as the temperature passes through the hysteresis loop. Without this check
the driver could heat up to its limits.

A displacement beyond the travel of the model, by more than m, is impossible at every temperature, and a lag of the
thermocouple cannot explain it. Such a displacement shows a reversed sensor or a wrong unit early.

The displacement also limits the temperature of the wire from above, whatever the thermocouple reads: a wire that is not
fully transformed is colder than the heating branch at this displacement, T₊(y + m) + δ. In the same way a wire that is
transformed is warmer than the cooling branch, T₋(y - m) - δ.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from math import inf, isfinite

import numpy as np

from smadrive.hysteresis import HysteresisModel
from smadrive.numerics.piecewise_linear import PiecewiseLinear
from smadrive.safety.temperature_band import UNBOUNDED, AtLeast

UNSURE_C = 10.0
"""δ: the largest difference between the temperature of the wire and the reading of the thermocouple, K."""

MARGIN = 0.1
"""Largest distance m of the displacement from the hysteresis loop of the model, as a share of the stroke."""

POINTS = 400
"""Number of points in the table of a branch."""


class DisplacementBand:
    """The band of possible displacements for the wire of `model`, as described at the head of this file."""

    def __init__(self, model: HysteresisModel) -> None:
        low_c, high_c = model.input_range
        warming_c = np.linspace(low_c, high_c, POINTS)
        loop_mm = model.simulate(np.concatenate([warming_c, warming_c[::-1]]))
        branches_mm = loop_mm[:POINTS], loop_mm[POINTS:][::-1]
        around_c = np.linspace(low_c - UNSURE_C, high_c + UNSURE_C, POINTS)
        shifted_c = around_c - UNSURE_C, around_c + UNSURE_C
        ends_mm = [np.interp(at_c, warming_c, branch_mm) for branch_mm in branches_mm for at_c in shifted_c]
        margin_mm = MARGIN * float(np.ptp(loop_mm))
        self._sense = 1.0 if loop_mm[POINTS - 1] >= loop_mm[0] else -1.0
        self._rising_mm = np.maximum.accumulate(self._sense * branches_mm[0]).tolist()
        self._falling_mm = np.maximum.accumulate(self._sense * branches_mm[1]).tolist()
        self._warming_c, self._margin_mm = warming_c.tolist(), margin_mm
        self._travel_mm = float(loop_mm.min()) - margin_mm, float(loop_mm.max()) + margin_mm
        self._branches = [PiecewiseLinear(warming_c, branch_mm) for branch_mm in branches_mm]
        self._low = PiecewiseLinear(around_c, np.min(ends_mm, axis=0) - margin_mm)
        self._high = PiecewiseLinear(around_c, np.max(ends_mm, axis=0) + margin_mm)

    def band_mm(self, temperature_c: float) -> tuple[float, float]:
        """Return the least and the greatest possible displacement in mm when the thermocouple reads `temperature_c`."""
        return self._low.at(temperature_c), self._high.at(temperature_c)

    def outside(self, temperature_c: float, displacement_mm: float) -> str | None:
        """Return a text that describes a displacement outside the band; None inside the band, or if a value is NaN."""
        if not (isfinite(temperature_c) and isfinite(displacement_mm)):
            return None
        low_mm, high_mm = self.band_mm(temperature_c)
        if low_mm <= displacement_mm <= high_mm:
            return None
        return f"{displacement_mm:.3f} mm measured, {low_mm:.2f} to {high_mm:.2f} mm possible at {temperature_c:.1f} °C"

    def is_beyond_travel(self, displacement_mm: float) -> bool:
        """Return True for a displacement that is impossible at every temperature; False for NaN."""
        low_mm, high_mm = self._travel_mm
        return displacement_mm < low_mm or displacement_mm > high_mm

    def hottest_c(self, displacement_mm: float) -> float:
        """Return the highest possible temperature of a wire at `displacement_mm`, °C.

        The result is infinite if the wire may be fully transformed at this displacement, and for NaN.
        """
        above = bisect_right(self._rising_mm, self._sense * displacement_mm + self._margin_mm)
        return self._warming_c[above] + UNSURE_C if above < POINTS and isfinite(displacement_mm) else inf

    def at_least(self, displacement_mm: float) -> AtLeast:
        """Return the lowest possible temperature and phase of a wire at `displacement_mm`.

        The result is `UNBOUNDED` if the wire may be fully martensite at this displacement, and for NaN.
        """
        least_mm = self._sense * displacement_mm - self._margin_mm
        below = bisect_left(self._falling_mm, least_mm)
        if not below or not isfinite(displacement_mm):
            return UNBOUNDED
        cold_mm, hot_mm = self._falling_mm[0], self._falling_mm[-1]
        return AtLeast(self._warming_c[min(below, POINTS - 1)] - UNSURE_C, (least_mm - cold_mm) / (hot_mm - cold_mm))

    def nearest_mm(self, temperature_c: float, displacement_mm: float) -> float:
        """Return `displacement_mm`, clamped to the range between the branches of the model at `temperature_c`."""
        ends = [branch.at(temperature_c) for branch in self._branches]
        return min(max(displacement_mm, min(ends)), max(ends))
