"""A manual step, and its controllers: one holds a current, the other holds a temperature.

A step does not need an identified wire. So the temperature is controlled with the nominal heat balance, and the power
is limited like the power of an excitation.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite, isnan, nan

from smadrive.control.controllers.excitation import power_envelope_w
from smadrive.control.controllers.feedback import PIGains, TemperatureFeedback
from smadrive.control.controllers.interface import Command
from smadrive.errors import ConfigError
from smadrive.measurement import Measurement
from smadrive.wire.heat_balance import HeatBalance

LONGEST_S = 86_400.0
"""The longest step: a day. At 20 Hz its log has about 200 MB."""

WHERE = "step"
"""The part `where` of the errors in this file."""


@dataclass(frozen=True)
class ManualStep:
    """A step that holds either the current `current_a` or the temperature `temperature_c` for `duration_s`.

    ConfigError unless exactly one of the two is given, and the duration is above 0 s and at most `LONGEST_S`.
    """

    current_a: float | None
    temperature_c: float | None
    duration_s: float

    def __post_init__(self) -> None:
        """Raise ConfigError for the reasons that the class names."""
        if (self.current_a is None) == (self.temperature_c is None):
            given = "none is given" if self.current_a is None else "both are given"
            cure = "give either a current or a temperature"
            raise ConfigError("needs exactly one of current and temperature", where=WHERE, value=given, cure=cure)
        if not 0.0 < self.duration_s <= LONGEST_S:
            where, limit = f"{WHERE}: duration", f"above 0 s, at most {LONGEST_S:g} s"
            cure = "choose a time within these limits"
            what = "not a number" if isnan(self.duration_s) else "cannot be used"
            raise ConfigError(what, where=where, value=f"{self.duration_s:g} s", limit=limit, cure=cure)

    def __str__(self) -> str:
        """Return the step as text, for example `80 °C for 30 s`."""
        held = f"{self.temperature_c:g} °C" if self.current_a is None else f"{self.current_a:g} A"
        return f"{held} for {self.duration_s:g} s"


class ConstantCurrentController:
    """Commands the same current at every tick."""

    def __init__(self, current_a: float, duration_s: float) -> None:
        self.duration_s = duration_s
        self._command = Command(current_a)

    def update(self, _time_s: float, _measurement: Measurement, _dt_s: float) -> Command:
        """Return the command for the coming period: always the same current."""
        return self._command


class ConstantTemperatureController:
    """Holds one temperature; the reading of the thermocouple counts as the temperature of the wire."""

    def __init__(
        self, setpoint_c: float, duration_s: float, balance: HeatBalance, gains: PIGains, current_limit_a: float
    ) -> None:
        self.duration_s = duration_s
        self._setpoint_c = setpoint_c
        self._balance = balance
        self._feedback = TemperatureFeedback(gains)
        self._limit_w = min(
            current_limit_a**2 * balance.resistance_cold_ohm, power_envelope_w(balance, setpoint_c, 0.0)
        )
        self._reading_c = nan

    def update(self, _time_s: float, measurement: Measurement, dt_s: float) -> Command:
        """Return the command for the coming period of `dt_s` seconds.

        An invalid reading of the thermocouple is replaced by the last valid reading. Without one, the current is zero.
        """
        if isfinite(measurement.temperature_c):
            self._reading_c = measurement.temperature_c
        if isnan(self._reading_c):
            return Command(0.0, setpoint_c=self._setpoint_c)
        feedforward_w = self._balance.power_w(self._setpoint_c, 0.0, 0.0)
        error_c = self._setpoint_c - self._reading_c
        power_w = self._feedback.update(error_c, feedforward_w, self._limit_w, dt_s)
        current_a = self._balance.current_a(power_w, 0.0)
        return Command(current_a, setpoint_c=self._setpoint_c, estimated_c=self._reading_c, power_w=power_w)
