"""PI feedback on temperature, or on the heat content of the wire, around a feedforward.

    command = clamp(feedforward + Kp e + I),    dI/dt = Ki e

Command, feedforward and the integral I are powers in W. The limits of the command are zero power and the largest power.
The error e is in K: the error of the temperature, or the error of the heat content divided by the heat capacity:

    e = T* - T + (Q / m c) (ξ* - ξ)

T is the temperature, ξ the phase, a star marks a setpoint, m c is the heat capacity (J/K), and Q the latent heat (J).
The heat content changes by the power minus the loss. So with Kp = m c / Tc this error decays with the chosen time
constant Tc, also within the transformation. An error of the temperature alone would decay more slowly within the
transformation, by the factor 1 + (Q / m c) dξ/dT.

With Ki = Kp / Ti the effect of a model error decays within about Ti. In the integral, e is limited to a small value,
because a large error shows that the wire is still moving. At a limit of the command the integral stays constant
(conditional integration). Back-calculation is not used: at every turning point the feedforward requests a negative
power, and back-calculation would then change the integral by a large amount.

A large error, for example after a step of the setpoint, is removed faster: the part of e beyond a bound has the gain
0.8 m c / Δt, with Δt the longest recent period. So the command stays at its limit until the wire is near the setpoint.
This gain is not used for a small error, because it would amplify the noise.

Bumpless transfer: a feedback that replaces another feedback adds the last command of the replaced feedback minus its
own first command. This difference then decays. With an error beyond the bound the command jumps, because the difference
would delay the wire. The power for a large error is meant for one period. So it is no part of the last command here: a
rest of it that decays would overheat the wire.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from math import exp, inf

from smadrive.wire.heat_balance import HeatBalance

HANDOVER_S = 0.2
"""Time constant of the decay of the difference that a bumpless transfer adds, s."""

INTEGRATED_C = 1.0
"""The integral counts an error only up to ± this value, K, unless the controller chooses another value."""

SOON = 0.8
"""Share of the large part of an error that one period removes. With 1, a wrong model would make an overshoot."""

REMEMBERED = 0.98
"""Factor per period by which the longest period is forgotten. The periods of a slow bus differ: the power for a large
error must not make an overshoot in the longest of them."""


@dataclass(frozen=True, slots=True)
class PIGains:
    """Gains of the temperature feedback: proportional gain in W/K, integral gain in W/(K s).

    `capacity_j_per_k` is the heat capacity of the wire, for the gain of a large error.
    """

    proportional_w_per_k: float
    integral_w_per_k_s: float
    capacity_j_per_k: float

    @classmethod
    def for_balance(cls, balance: HeatBalance, closed_loop_s: float, integral_s: float) -> PIGains:
        """Return the gains for a wire with the heat balance `balance`.

        `closed_loop_s` is the time constant of the closed loop. `integral_s` is the integral time, in which the effect
        of a model error decays.
        """
        proportional = balance.heat_capacity_j_per_k / closed_loop_s
        return cls(proportional, proportional / integral_s, balance.heat_capacity_j_per_k)


@dataclass(slots=True)
class TemperatureFeedback:
    """PI feedback with anti-windup, and with bumpless transfer from another feedback.

    gains          proportional and integral gain
    integrated_c   the integral counts an error only up to ± this value, K
    integral_w     integral term, W
    lasting_w      last command without the power for a large error, W
    """

    gains: PIGains
    integrated_c: float = INTEGRATED_C
    integral_w: float = field(default=0.0, init=False)
    lasting_w: float = field(default=0.0, init=False)
    _handover_w: float = field(default=0.0, init=False)
    _takes_over: bool = field(default=False, init=False)
    _longest_s: float = field(default=0.0, init=False)

    def take_over(self, before: TemperatureFeedback, integral_w: float) -> None:
        """Continue from the feedback `before`, with the integral `integral_w`, W.

        The first command equals the last command of `before`, or the new limit if that is lower, unless one of their
        errors is beyond the bound.
        """
        self.integral_w, self.lasting_w = integral_w, before.lasting_w
        self._takes_over, self._longest_s = True, before._longest_s

    def update(
        self,
        error_c: float,
        feedforward_w: float,
        limit_w: float,
        dt_s: float,
        faster: float = 1.0,
        small_c: float = inf,
        *,
        is_held_back: bool = False,
    ) -> float:
        """Return the power to command for the next `dt_s`, W, from 0 to `limit_w`.

        `error_c` is the error, setpoint - process value, K. The part of it beyond ± `small_c` is removed at once.
        `feedforward_w` is the power of the feedforward. Both gains are multiplied by `faster`. The integral does not
        grow while the request is beyond 0 or `limit_w`, and while `is_held_back`: a limit has reduced the last command.
        """
        near_c = min(max(error_c, -small_c), small_c)
        self._longest_s = max(dt_s, REMEMBERED * self._longest_s)
        far_w = SOON * self.gains.capacity_j_per_k * (error_c - near_c) / self._longest_s
        near_w = feedforward_w + faster * self.gains.proportional_w_per_k * near_c + self.integral_w
        requested_w, lasting_w = _limited(near_w + far_w, limit_w), _limited(near_w, limit_w)
        if requested_w == near_w + far_w and not (is_held_back and error_c > 0.0):
            counted_c = min(max(error_c, -self.integrated_c), self.integrated_c)
            self.integral_w += faster * self.gains.integral_w_per_k_s * counted_c * dt_s
        self._handover_w = self._handover(lasting_w, dt_s, is_far=near_c != error_c)
        self.lasting_w = _limited(lasting_w + self._handover_w, limit_w)
        return _limited(requested_w + self._handover_w, limit_w)

    def _handover(self, lasting_w: float, dt_s: float, *, is_far: bool) -> float:
        """Return the power that makes a transfer bumpless, W. `lasting_w` is the own command without this power."""
        if not self._takes_over:
            return self._handover_w * exp(-dt_s / HANDOVER_S)
        self._takes_over = False
        return 0.0 if is_far else self.lasting_w - lasting_w


def _limited(power_w: float, limit_w: float) -> float:
    return min(max(power_w, 0.0), limit_w)
