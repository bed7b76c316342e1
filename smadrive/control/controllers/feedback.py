"""PI feedback on temperature around a feedforward.

    command = clamp(feedforward + Kp e + I),    dI/dt = Ki e while the command is inside its limits

Anti-windup by conditional integration: the feedforward alone drives the command deep into its lower limit at every
turning point (no negative power exists), and back-calculation would then tear the integral away from the small model
error it stands for. Gains follow from the heat balance by pole placement: with Kp = m c / Tc the error decays with the
chosen time constant Tc, with Ki = Kp / Ti a model error is gone after Ti.

Bumpless transfer: a feedback that takes over from another adds what the command would jump by, and lets it decay.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from math import exp

from smadrive.wire.heat_balance import HeatBalance

HANDOVER_S = 1.0
"""Time constant with which the difference to the command of a feedback taken over from decays."""

INTEGRATED_C = 1.0
"""More than this of an error is not integrated: it is a way to go (the wire crosses its hysteresis), no model error."""


@dataclass(frozen=True, slots=True)
class PIGains:
    """Kp in W/K and Ki in W/(K s)."""

    proportional_w_per_k: float
    integral_w_per_k_s: float

    @classmethod
    def for_balance(cls, balance: HeatBalance, closed_loop_s: float, integral_s: float) -> PIGains:
        """Gains that give the wire `closed_loop_s` as closed-loop time constant and `integral_s` as integral time."""
        proportional = balance.heat_capacity_j_per_k / closed_loop_s
        return cls(proportional, proportional / integral_s)


@dataclass(slots=True)
class TemperatureFeedback:
    """The PI controller above. Its state is the integral, the last command and what is left of a handover, in watts."""

    gains: PIGains
    integral_w: float = field(default=0.0, init=False)
    command_w: float = field(default=0.0, init=False)
    _handover_w: float = field(default=0.0, init=False)
    _takes_over: bool = field(default=False, init=False)

    def take_over(self, before: TemperatureFeedback) -> None:
        """Go on from `before`: the first command is its last one."""
        self.integral_w, self.command_w = before.integral_w, before.command_w
        self._takes_over = True

    def update(self, error_c: float, feedforward_w: float, limit_w: float, dt_s: float) -> float:
        """The power command in [0, `limit_w`], W, for error = setpoint - process value."""
        requested_w = feedforward_w + self.gains.proportional_w_per_k * error_c + self.integral_w
        if self._takes_over:
            self._handover_w = self.command_w - min(max(requested_w, 0.0), limit_w)
            self._takes_over = False
        else:
            self._handover_w *= exp(-dt_s / HANDOVER_S)
        unclamped = requested_w + self._handover_w
        self.command_w = min(max(unclamped, 0.0), limit_w)
        if self.command_w == unclamped:
            counted_c = min(max(error_c, -INTEGRATED_C), INTEGRATED_C)
            self.integral_w += self.gains.integral_w_per_k_s * counted_c * dt_s
        return self.command_w
