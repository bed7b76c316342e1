"""The outer loop of a rig that measures displacement: an integral term against errors of the models.

The inverse starts from the measured displacement, so an error decays with the time constant Tc of the temperature loop.
One error remains: a wire that moves more (or less) per kelvin than its model leads (or lags) the setpoint. This error
is Tc times the difference between the rates of wire and setpoint. The trim is added to the setpoint before the inverse:

    d(trim)/dt = (setpoint - displacement) / Ti        Ti = 4 Tc, the usual separation of the loops of a cascade

The trim is in millimetres, so it has the same effect on steep and on flat parts of the loop. The trim must not act
against the hysteresis, and must not grow where it has no effect. It stays constant

    while the wire crosses the loop: its temperature differs from the setpoint by more than `FOLLOWS_C`, and its
        displacement cannot respond yet
    while a limit holds the power back
    while the wire cannot get nearer to the setpoint, as at an end of its travel

Without a measured displacement the trim decays with the time constant Ti, because one missing reading says nothing
about the model. If the wire is ahead of a setpoint that stands still, the trim lets it cross the loop once, after some
seconds. With the hysteresis inverse it is at most `MOST` of the stroke: a larger error is no error of a model. A static
map has no hysteresis, so its error can be as large as the loop is wide, and the trim as large as the stroke. With the
hysteresis inverse, a reversal sets the trim to zero, because the errors of the two branches are independent.
"""

from __future__ import annotations

from math import exp

SLOWER = 4.0
"""Integral time of the trim, as a multiple of the closed-loop time constant of the temperature."""

FOLLOWS_C = 0.3
"""The trim stays constant while the temperature differs from its setpoint by more than this, K."""


MOST = 0.03
"""Largest trim with the hysteresis inverse, as a share of the stroke."""


class DisplacementTrim:
    """The integral term of the displacement error: a trim in mm, which is added to the displacement setpoint.

    `hysteretic` says if the inverse knows the hysteresis of the wire.
    """

    def __init__(self, closed_loop_s: float, stroke_mm: float, *, hysteretic: bool) -> None:
        self._integral_s = SLOWER * closed_loop_s
        self._most_mm = MOST * stroke_mm if hysteretic else stroke_mm

    def update(self, trim_mm: float, error_mm: float, error_c: float, dt_s: float) -> float:
        """Return the new trim, mm, `dt_s` seconds after the trim was `trim_mm`.

        `error_mm` and `error_c` are setpoint - process value of displacement and temperature. The trim stays constant
        while `error_c` exceeds `FOLLOWS_C` in absolute value; it is infinite in the other cases above.
        """
        if abs(error_c) > FOLLOWS_C:
            return trim_mm
        return min(max(trim_mm + error_mm * dt_s / self._integral_s, -self._most_mm), self._most_mm)

    def forgotten(self, trim_mm: float, dt_s: float) -> float:
        """Return the trim, mm, `dt_s` seconds after the trim was `trim_mm`, without a measured displacement."""
        return trim_mm * exp(-dt_s / self._integral_s)
