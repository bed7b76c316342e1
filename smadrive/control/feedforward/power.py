"""Displacement → temperature → power: the inverse hysteresis and the inverse heat balance on the estimated state.

The temperature of the inverse is moved by the estimated shift of the transformation, and the estimated power that the
heat balance does not explain is subtracted. In a disturbance the wire does not wait for a reference that it leads by
more than the tolerance, because the disturbance changes its lead faster than the reference does.
"""

from __future__ import annotations

from typing import NamedTuple

from smadrive.control.estimation.wire_estimate import WireEstimate
from smadrive.control.feedforward.displacement import DisplacementInverse, at_once
from smadrive.wire.wire_model import WireModel

DISTURBED = 0.5
"""Above this level of evidence (innovation.py) the wire is in a disturbance."""


class Feedforward(NamedTuple):
    """The setpoint of the wire temperature, the power for it, and the displacement that the wire then has.

    `reachable` is False if the wire cannot get nearer to the displacement setpoint. `turns_back` is True if the wire
    turns back to a reference that it leads.
    """

    temperature_c: float
    power_w: float
    displacement_mm: float
    reachable: bool
    turns_back: bool = False


class DisplacementFeedforward:
    """Computes temperature (by the inverse hysteresis) and power (by the inverse heat balance) for a displacement."""

    def __init__(self, inverse: DisplacementInverse, wire: WireModel) -> None:
        self._inverse = inverse
        self._travel_mm = wire.travel_mm
        self._balance = wire.balance

    def update(
        self,
        estimate: WireEstimate,
        setpoint_mm: float,
        rate_mm_per_s: float,
        direction: int,
        *,
        turns_back: bool = False,
    ) -> Feedforward:
        """Return temperature setpoint and power for the displacement `setpoint_mm`, which moves at `rate_mm_per_s`.

        `estimate` is the estimated state of the wire. Its `shift_c` is added to the temperature of the inverse, and its
        `disturbance_w` is subtracted from the power. `direction` is the direction of the reference: +1 towards the hot
        end of the travel, -1 towards the cold end. `turns_back` is that of the last feedforward.
        """

        def cooling_s(from_c: float, to_c: float) -> float:
            return self._balance.cooling_s(from_c + estimate.shift_c, to_c + estimate.shift_c)

        crossing_s = at_once if estimate.evidence.level > DISTURBED else cooling_s
        state = estimate.hysteresis
        target = self._inverse.target(state, setpoint_mm, direction, rate_mm_per_s, crossing_s, turns_back=turns_back)
        rate_c_per_s = target.k_per_mm * rate_mm_per_s
        temperature_c = target.temperature_c + estimate.shift_c
        power_w = self._balance.power_w(temperature_c, rate_c_per_s, rate_mm_per_s / self._travel_mm)
        power_w -= estimate.disturbance_w
        return Feedforward(temperature_c, power_w, target.displacement_mm, target.reachable, target.turns_back)

    def hold(self, estimate: WireEstimate, temperature_c: float, displacement_mm: float) -> Feedforward:
        """Return the given setpoints of temperature and displacement, and the power that holds the wire there."""
        power_w = self._balance.power_w(temperature_c, 0.0, 0.0) - estimate.disturbance_w
        return Feedforward(temperature_c, power_w, displacement_mm, reachable=True)
