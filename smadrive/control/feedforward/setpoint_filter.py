"""The filter of the temperature setpoint, for a place between the branches, where the wire hardly moves.

The inverse hysteresis divides by the slope of the phase over the temperature. Between the branches this slope is small.
So the noise of a displacement sensor becomes some kelvin of noise in the setpoint, and the current would jump to zero
and back. But there an error of one kelvin moves the wire by about this noise or less. So the setpoint T* is filtered,

    T ← T + (1 - φ exp(-Δt / τ)) (T* - T),    φ = (1 - ε) / (1 + (slope / FLAT_PER_K)²)

with τ = `FILTER_S`. The slope is that in the direction of the reference: within a branch it is large, and φ is nearly
0. In a disturbance with evidence ε (innovation.py) the place of the branches is uncertain, and the setpoint is filtered
less. A change of more than `NEW_C` is no noise, such as that at the beginning of a reversal in a wide loop: it is not
filtered. The price is a delay where the wire comes to a branch, by some hundredths of a second.
"""

from __future__ import annotations

from math import exp

from smadrive.control.estimation.wire_estimate import WireEstimate
from smadrive.wire.wire_model import WireModel

FILTER_S = 0.13
"""Time constant of the filter between the branches, s."""

FLAT_PER_K = 0.0015
"""Slope of the phase at which φ is one half, 1/K. One kelvin then moves the wire by 0.15 % of the stroke.

In the middle of a branch the slope is about 0.05.
"""

NEW_C = 6.0
"""A larger change of the setpoint is not filtered, K."""


class SetpointFilter:
    """Filters the temperature setpoint of one wire."""

    def __init__(self, wire: WireModel) -> None:
        self._model, self._travel_mm = wire.model, wire.travel_mm

    def update(self, last_c: float, setpoint_c: float, estimate: WireEstimate, direction: int, dt_s: float) -> float:
        """Return the filtered setpoint, °C, `dt_s` after it was `last_c`. `setpoint_c` is the setpoint now.

        `estimate` is the estimated state of the wire. `direction` is the direction of the reference: +1 towards the hot
        end of the travel, -1 towards the cold end.
        """
        change_c = setpoint_c - last_c
        if abs(change_c) > NEW_C:
            return setpoint_c
        per_k = self._model.slope(estimate.hysteresis, direction) / self._travel_mm
        flatness = (1.0 - estimate.evidence.level) / (1.0 + (per_k / FLAT_PER_K) ** 2)
        return last_c + (1.0 - flatness * exp(-dt_s / FILTER_S)) * change_c
