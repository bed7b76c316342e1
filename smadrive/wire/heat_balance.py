"""Heat balance of the wire and its inverse.

The whole wire has one temperature T, and one phase ξ, which rises from 0 (cold) to 1 (hot):

    m c · dT/dt = P - Q · dξ/dt - h A (T - T_ambient)        P = I² R(ξ),  R(ξ) = R_cold (1 + r ξ),  Q = m L_h

    m mass, c specific heat, L_h latent heat per mass, h A heat loss per kelvin, P power, I current, R resistance,
    r relative change of the resistance between the cold and the transformed wire

The wire absorbs the latent heat Q on heating and gives it back on cooling. In the middle of the transformation Q
doubles the apparent heat capacity, so the feedforward needs Q. The sign of r differs between wires, so r is fitted.
The thermocouple is a bead on the wire. Its reading T_tc follows with a first-order lag: lag · dT_tc/dt = T - T_tc.

If the resistance is identified, `WireModel.resistance_ohm` takes R(T, ξ) of identified_resistance.py in place of R(ξ).
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from enum import StrEnum
from math import exp, inf, isfinite, log, sqrt

from smadrive.errors import ModelError


class BalanceSource(StrEnum):
    """The origin of a heat balance's parameters; the assumed uncertainty depends on it."""

    DATA_SHEET = "data sheet"
    """The wire's data sheet."""
    IDENTIFIED = "identified"
    """A fit to a record of this wire."""


FRESH, FRESH_PERIODS = 0.25, 1.5
"""A displacement is fresh up to this fraction of the wire's time constant, and at least for this number of periods of
the loop: then one lost reply of a sensor that is read in every period does not make its displacement old."""

MOST_NOISE_C = 100.0
"""Largest standard deviation of the noise of a thermocouple, K."""

RESISTANCE_CHANGE = "heat balance: resistance_change"


@dataclass(frozen=True, slots=True)
class HeatBalance:
    """Parameters of the heat balance at the head of this file, their source, and the equations as methods.

    `thermocouple_noise_c` is the standard deviation of the noise of the thermocouple in the record of the wire, K; 0 if
    it was not measured. Raises ModelError for a parameter that is out of its range or not finite.
    """

    heat_capacity_j_per_k: float
    loss_w_per_k: float
    latent_heat_j: float
    ambient_c: float
    resistance_cold_ohm: float
    resistance_change: float
    thermocouple_lag_s: float
    source: BalanceSource = BalanceSource.IDENTIFIED
    thermocouple_noise_c: float = 0.0

    def __post_init__(self) -> None:
        """Raise ModelError for a parameter that is not finite or out of its range."""
        for name in ("heat_capacity_j_per_k", "loss_w_per_k", "resistance_cold_ohm"):
            value = getattr(self, name)
            if not value > 0:
                raise ModelError("not positive", where=f"heat balance: {name}", value=value)
        for name in ("latent_heat_j", "thermocouple_lag_s", "thermocouple_noise_c"):
            value = getattr(self, name)
            if not value >= 0:
                raise ModelError("negative", where=f"heat balance: {name}", value=value)
        for name in PARAMETERS:
            if not isfinite(value := getattr(self, name)):
                raise ModelError("not finite", where=f"heat balance: {name}", value=value)
        if self.thermocouple_noise_c > MOST_NOISE_C:
            where, value = "heat balance: thermocouple_noise_c", self.thermocouple_noise_c
            raise ModelError("more than any thermocouple has", where=where, value=value, limit=MOST_NOISE_C)
        if not self.resistance_change > -1:
            value = self.resistance_change
            raise ModelError("leaves the hot wire without resistance", where=RESISTANCE_CHANGE, value=value, limit=-1)

    @property
    def time_constant_s(self) -> float:
        """Time constant τ = m c / (h A) of the wire without transformation, s."""
        return self.heat_capacity_j_per_k / self.loss_w_per_k

    def fresh_s(self, period_s: float) -> float:
        """Return the age up to which a displacement tells the present state of the wire, s.

        `period_s` is the period of the loop.
        """
        return max(FRESH * self.time_constant_s, FRESH_PERIODS * period_s)

    def assumed_noise_c(self, least_c: float) -> float:
        """Return the noise of the thermocouple that a controller assumes, K: of the record, or `least_c` if larger.

        Too small a noise makes an estimate wrong by percents of the stroke, while too large a noise costs little.
        """
        return max(self.thermocouple_noise_c, least_c)

    def resistance_ohm(self, phase: float) -> float:
        """Return the resistance R(ξ) at the phase ξ, Ω."""
        return self.resistance_cold_ohm * (1.0 + self.resistance_change * phase)

    def step(self, temperature_c: float, power_w: float, phase_per_k: float, dt_s: float) -> float:
        """Return the wire temperature in °C after `dt_s` at constant `power_w`.

        This is exact for a constant slope of the phase, dξ/dT = `phase_per_k`.
        """
        settled_c = self.ambient_c + power_w / self.loss_w_per_k
        capacity = self.heat_capacity_j_per_k + self.latent_heat_j * phase_per_k
        return settled_c + (temperature_c - settled_c) * exp(-dt_s * self.loss_w_per_k / capacity)

    def cooling_s(self, from_c: float, to_c: float) -> float:
        """Return the time in which the wire cools without power and without transformation, s.

        It is τ log((from - ambient) / (to - ambient)): 0 if the wire is already as cold, infinite if the temperature
        `to_c` is not above the ambient temperature.
        """
        if from_c <= to_c:
            return 0.0
        if to_c <= self.ambient_c:
            return inf
        return self.time_constant_s * log((from_c - self.ambient_c) / (to_c - self.ambient_c))

    def step_thermocouple(self, reading_c: float, wire_before_c: float, wire_after_c: float, dt_s: float) -> float:
        """Return the reading of the thermocouple in °C after `dt_s`.

        This is exact if the wire temperature changes linearly from `wire_before_c` to `wire_after_c`.
        """
        lag_s = self.thermocouple_lag_s
        if lag_s <= 0:
            return wire_after_c
        decay = exp(-dt_s / lag_s)
        ramp_c = wire_after_c - wire_before_c
        return wire_before_c + (reading_c - wire_before_c) * decay + ramp_c * (1.0 - (1.0 - decay) * lag_s / dt_s)

    def power_w(self, temperature_c: float, rate_c_per_s: float, phase_rate_per_s: float) -> float:
        """Return the power in W at which the wire at `temperature_c` has these rates of temperature and phase.

        This is the inverse heat balance. A negative result means that the wire cannot cool so fast.
        """
        return (
            self.heat_capacity_j_per_k * rate_c_per_s
            + self.latent_heat_j * phase_rate_per_s
            + self.loss_w_per_k * (temperature_c - self.ambient_c)
        )

    def current_a(self, power_w: float, phase: float) -> float:
        """Return the current in A that gives `power_w` at this phase; 0 for a negative power."""
        return sqrt(max(power_w, 0.0) / self.resistance_ohm(phase))


PARAMETERS = tuple(field.name for field in fields(HeatBalance) if field.name != "source")
"""The names of the numeric parameters."""
