"""The outer loop of a rig that measures displacement: an integral term against errors of the models.

The inverse already starts from the measured displacement, so an error decays with the time constant Tc of the
temperature loop. But a wire that moves more or less per kelvin than its model leads or lags by Tc times the difference
of the rates. The trim is added to the setpoint before the inverse:

    trim' = (setpoint - displacement) / Ti        Ti = 4 Tc, the usual separation of the loops of a cascade

The trim is in millimetres, so it has the same effect where the loop is steep and where it is flat. It must not fight
the hysteresis. While the wire crosses the loop (its temperature differs from the setpoint) or the power is at a limit,
no response of the displacement is due yet, and the trim stays constant. At a reversal it begins at zero, because the
errors of the two branches are independent.
"""

from __future__ import annotations

SLOWER = 4.0
"""Integral time of the trim over the closed-loop time constant of the temperature."""

FOLLOWS_C = 0.3
"""The trim stays constant while the temperature differs from its setpoint by more than this, K."""


class DisplacementTrim:
    """The integral above, in mm."""

    def __init__(self, closed_loop_s: float) -> None:
        self._integral_s = SLOWER * closed_loop_s

    def update(self, trim_mm: float, error_mm: float, error_c: float, dt_s: float) -> float:
        """The trim after `dt_s` with these errors, setpoint - process value, in displacement and temperature."""
        return trim_mm + error_mm * dt_s / self._integral_s if abs(error_c) <= FOLLOWS_C else trim_mm
