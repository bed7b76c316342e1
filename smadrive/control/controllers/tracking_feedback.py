"""The feedback of a TrackingController: gains, error and limits for a measured and for an unmeasured displacement.

With a measured displacement the error is that of the heat content (see feedback.py), the closed loop is faster, and a
large error is removed at once. The estimate of an unmeasured displacement is less certain. So then the error is that of
the temperature, and only a large error of the estimated displacement is added.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import inf

from smadrive.control.controllers.feedback import INTEGRATED_C, PIGains, TemperatureFeedback
from smadrive.control.estimation.wire_estimate import WireEstimate
from smadrive.control.feedforward.power import Feedforward
from smadrive.measurement import DisplacementFrom
from smadrive.wire.wire_model import WireModel

FASTER = 2.5
"""With a measured displacement the estimate has less noise, and the closed loop is faster by at most this factor."""

SHORTEST_PERIODS = 2.0
"""Shortest time constant of the closed loop with a measured displacement, in periods of the loop."""

INTEGRATED_WITH_OBSERVER_C = 0.1
"""With `feedforward_share` = 1, the integral counts an error up to ± this value, K.

The observer then compensates the errors of the heat balance, and the integral would only overshoot after a large error.
"""

SMALL_C = 1.0
"""With a measured displacement and `feedforward_share` = 1, the part of an error beyond this is removed at once, K.

It is 2 to 3 % of the stroke.
"""

SMALL_DISTURBED_C = 6.0
"""The same in a disturbance, K. The branches may then be some kelvin away from where the model has them."""

UNCERTAIN_C = 1.0
"""Only the part of an unmeasured displacement's error beyond this counts, as heat content, K: about 3 % of the stroke.
"""


@dataclass(frozen=True, slots=True)
class TrackingSettings:
    """Settings of a TrackingController. Its gains follow from the heat balance of the wire.

    period_s            period of the loop, s
    current_limit_a     largest current, A
    closed_loop_s       time constant of the temperature loop without a measured displacement, s; see `FASTER`
    integral_s          time constant in which the effect of a model error decays, s
    noise_c             least assumed noise of the thermocouple, K; see `HeatBalance.assumed_noise_c`
    feedforward_share   share of the feedforward's power that is used; less than 1 leaves more to the feedback
    displacement_from   source of the displacement
    """

    period_s: float
    current_limit_a: float
    closed_loop_s: float
    integral_s: float
    noise_c: float
    feedforward_share: float = 1.0
    displacement_from: DisplacementFrom = DisplacementFrom.SENSOR


class TrackingFeedback:
    """Adds the feedback to the feedforward of a wire."""

    def __init__(self, wire: WireModel, settings: TrackingSettings) -> None:
        self._balance, self._share = wire.balance, settings.feedforward_share
        gains = PIGains.for_balance(wire.balance, settings.closed_loop_s, settings.integral_s)
        integrated_c = INTEGRATED_WITH_OBSERVER_C if self._share == 1.0 else INTEGRATED_C
        self.temperature = TemperatureFeedback(gains, integrated_c)
        seeing_s = max(settings.closed_loop_s / FASTER, SHORTEST_PERIODS * settings.period_s)
        self._faster = max(settings.closed_loop_s / seeing_s, 1.0)
        self._latent_k_per_mm = wire.balance.latent_heat_j / wire.balance.heat_capacity_j_per_k / wire.travel_mm

    def update(
        self,
        target: Feedforward,
        ahead: WireEstimate,
        limit_w: float,
        dt_s: float,
        *,
        is_measured: bool,
        is_held_back: bool = False,
    ) -> float:
        """Return the power of feedforward and feedback for the next `dt_s`, W, from 0 to `limit_w`.

        `ahead` is the estimate at the beginning of this time. `is_measured` is True if its displacement is measured,
        `is_held_back` if a limit of device or driver reduced the last command.
        """
        error_c, feedforward_w = target.temperature_c - ahead.temperature_c, self._share * target.power_w
        latent_c = self._latent_k_per_mm * (target.displacement_mm - ahead.hysteresis.y)
        feedback = self.temperature
        if is_measured:
            small_c = self._small_c(ahead.evidence.level)
            error_c += latent_c
            return feedback.update(
                error_c, feedforward_w, limit_w, dt_s, self._faster, small_c, is_held_back=is_held_back
            )
        certain_c = latent_c - min(max(latent_c, -UNCERTAIN_C), UNCERTAIN_C)
        return feedback.update(error_c + certain_c, feedforward_w, limit_w, dt_s, is_held_back=is_held_back)

    def _small_c(self, level: float) -> float:
        """Return the bound of a small error, K. `level` is the level of the evidence of a disturbance, from 0 to 1."""
        return SMALL_C + level * (SMALL_DISTURBED_C - SMALL_C) if self._share == 1.0 else inf

    def take_over(self, before: TrackingFeedback, temperature_c: float) -> None:
        """Continue from the feedback `before` of a wire at `temperature_c`, without a jump after a small error.

        The integral is that of `before` if both use the same share of the feedforward. Otherwise it is the power that
        the new share leaves to the integral at this temperature.
        """
        integral_w = before.temperature.integral_w
        if before._share != self._share:
            integral_w = (1.0 - self._share) * self._balance.power_w(temperature_c, 0.0, 0.0)
        self.temperature.take_over(before.temperature, integral_w)
