"""PI feedback on temperature around a feedforward.

    command = clamp(feedforward + Kp e + I),    dI/dt = Ki e while the command is inside its limits

Command, feedforward and the integral I are powers in W. e is the error of the temperature in K; in the integral, e is
limited to ± `INTEGRATED_C`. I compensates a small model error. The limits of the command are zero power and the largest
power. At a limit the integral stays constant (conditional integration). Back-calculation is not used: at every turning
point the feedforward requests a negative power, and back-calculation would then change the integral by a large amount.

The gains follow from the heat balance by pole placement. With the heat capacity m c of the wire (J/K) and
Kp = m c / Tc, the error decays with the chosen time constant Tc. With Ki = Kp / Ti the effect of a model error decays
within about Ti.

Bumpless transfer: a feedback that replaces another feedback adds the difference of the two commands, which then decays.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from math import exp

from smadrive.wire.heat_balance import HeatBalance

HANDOVER_S = 1.0
"""The difference to the last command of the replaced feedback decays with this time constant, s."""

INTEGRATED_C = 1.0
"""The integral counts an error only up to ± this value, K. A larger error shows that the wire is still moving."""


@dataclass(frozen=True, slots=True)
class PIGains:
    """Gains of the temperature feedback: proportional gain in W/K, integral gain in W/(K s)."""

    proportional_w_per_k: float
    integral_w_per_k_s: float

    @classmethod
    def for_balance(cls, balance: HeatBalance, closed_loop_s: float, integral_s: float) -> PIGains:
        """Return the gains for a wire with the heat balance `balance`.

        `closed_loop_s` is the time constant of the closed loop. `integral_s` is the integral time, in which the effect
        of a model error decays.
        """
        proportional = balance.heat_capacity_j_per_k / closed_loop_s
        return cls(proportional, proportional / integral_s)


@dataclass(slots=True)
class TemperatureFeedback:
    """PI feedback on temperature, with anti-windup, and with bumpless transfer from another feedback.

    `integral_w` is the integral term, and `command_w` is the last command, both in W.
    """

    gains: PIGains
    integral_w: float = field(default=0.0, init=False)
    command_w: float = field(default=0.0, init=False)
    _handover_w: float = field(default=0.0, init=False)
    _takes_over: bool = field(default=False, init=False)

    def take_over(self, before: TemperatureFeedback) -> None:
        """Continue from the feedback `before`: its integral is kept, and its last command is the first command.

        The first command differs if the power that this feedback requests is below 0 or above the limit.
        """
        self.integral_w, self.command_w = before.integral_w, before.command_w
        self._takes_over = True

    def update(self, error_c: float, feedforward_w: float, limit_w: float, dt_s: float) -> float:
        """Return the power to command for the next `dt_s`, W, from 0 to `limit_w`.

        `error_c` is setpoint - process value of the temperature, K. `feedforward_w` is the power of the feedforward.
        """
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
