"""A static temperature map: the baseline with which comparisons measure the inverse feedforward."""

from __future__ import annotations

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from smadrive.control.feedforward.displacement import CoolingTime, TemperatureTarget, at_once
from smadrive.errors import DataError
from smadrive.hysteresis import HysteresisState

MAP_LEVELS = 13
"""Entries of the static map, as in a table that is made by hand: one per millimetre of a travel of 12 mm.

In the middle of the loop the fit jumps by some kelvin, because there the wire is as often at one end of its travel as
at the other. Between entries that are closer, this jump is so steep that the loop of the displacement oscillates.
"""


class StaticMap:
    """A static temperature map: the displacement is a monotone function of the temperature, without hysteresis.

    The map is fitted to a record by isotonic regression and tabulated at `MAP_LEVELS` displacements. It runs about
    midway between the branches, like a calibration table. Comparisons use it as the baseline for the inverse
    feedforward.
    """

    hysteretic = False

    def __init__(self, temperature_c: ArrayLike, displacement_mm: ArrayLike) -> None:
        temperature = np.asarray(temperature_c, dtype=np.float64)
        displacement = np.asarray(displacement_mm, dtype=np.float64)
        if temperature.shape != displacement.shape or temperature.size < 2:
            raise DataError(
                "needs two columns of the same length, with 2 samples at least",
                where="static map",
                value=(temperature.shape, displacement.shape),
            )
        order = np.argsort(temperature, kind="stable")
        rising = np.corrcoef(temperature, displacement)[0, 1] >= 0
        fit = scipy.optimize.isotonic_regression(displacement[order], increasing=bool(rising))
        level, first = np.unique(fit.x, return_index=True)
        self._displacement_mm = np.linspace(level[0], level[-1], MAP_LEVELS)
        self._temperature_c: NDArray[np.float64] = np.interp(self._displacement_mm, level, temperature[order][first])

    def target(
        self,
        state: HysteresisState,
        setpoint_mm: float,
        direction: int,  # noqa: ARG002
        rate_mm_per_s: float = 0.0,  # noqa: ARG002
        cooling_s: CoolingTime = at_once,  # noqa: ARG002
        *,
        turns_back: bool = False,  # noqa: ARG002
    ) -> TemperatureTarget:
        """Return the temperature of the map at `setpoint_mm`; the history of the wire has no effect.

        Outside the displacements of the map, the result is the temperature at the end of the map, with the derivative 0
        and with `reachable` False.
        """
        at = int(np.searchsorted(self._displacement_mm, setpoint_mm))
        if not 0 < at < MAP_LEVELS:
            end_c = float(self._temperature_c[min(at, MAP_LEVELS - 1)])
            return TemperatureTarget(end_c, 0.0, state.y, reachable=False)
        (y0, y1), (t0, t1) = self._displacement_mm[at - 1 : at + 1], self._temperature_c[at - 1 : at + 1]
        k_per_mm = float((t1 - t0) / (y1 - y0))
        return TemperatureTarget(float(t0) + k_per_mm * (setpoint_mm - float(y0)), k_per_mm, state.y)
