"""The outer loop, where the displacement is measured: an integral that makes up for what the models leave.

The inverse already starts from the measured displacement, so an error decays with the time constant Tc of the
temperature loop; but a wire that answers a kelvin by more or less than its model lags or leads by Tc times the missing
rate. The trim is added to the reference before the inverse:

    trim' = (reference - displacement) / Ti        Ti = 4 Tc, the usual separation of a cascade's loops

In millimetres, so that it means the same where the loop is steep and where it is flat. It must not fight the
hysteresis: while the wire is on its way across (the temperature is not where it is wanted) or the power is at a limit,
no answer is due and it stands still; at a turn it begins anew, for what it learned on one branch says nothing about the
other.
"""

from __future__ import annotations

SLOWER = 4.0
"""Integral time of the trim over the closed-loop time constant of the temperature."""

FOLLOWS_C = 0.3
"""The wire is on its way, and owes no answer, when its temperature is farther from the wanted one than this, K."""


class DisplacementTrim:
    """The integral above, in mm."""

    def __init__(self, closed_loop_s: float) -> None:
        self._integral_s = SLOWER * closed_loop_s

    def update(self, trim_mm: float, error_mm: float, error_c: float, dt_s: float) -> float:
        """The trim after `dt_s` with these errors, setpoint - process value, in displacement and temperature."""
        return trim_mm + error_mm * dt_s / self._integral_s if abs(error_c) <= FOLLOWS_C else trim_mm
