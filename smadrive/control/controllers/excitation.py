"""The controller of an excitation, and the largest power for a wire that is not identified yet."""

from __future__ import annotations

from collections.abc import Callable
from math import isfinite, isnan, nan

from smadrive.control.controllers.feedback import PIGains, TemperatureFeedback
from smadrive.control.controllers.interface import Command
from smadrive.errors import IdentificationError
from smadrive.measurement import Measurement
from smadrive.safety.temperature_band import TRANSFORMATION_C
from smadrive.wire.heat_balance import HeatBalance

LAGS_C = 6.0
"""The path of an excitation waits while the temperature differs from the path by more than this, K."""

STALLS_S = 30.0
"""The longest uninterrupted wait of the path, s."""

ENVELOPE = 2.0
"""The largest power of an excitation, as a multiple of the power that its path needs by the data sheet.

A failing thermocouple is detected later on an unknown wire than on an identified one. With this limit the wire
overheats more slowly until the fault is detected.
"""


def power_envelope_w(balance: HeatBalance, setpoint_c: float, rate_c_per_s: float) -> float:
    """Return the largest power, W, that a controller may command to a wire that is not identified yet.

    `setpoint_c` is the present temperature setpoint. The setpoint moves at `rate_c_per_s`, 0 or more.
    """
    transforming = balance.latent_heat_j / TRANSFORMATION_C * rate_c_per_s
    return ENVELOPE * (balance.power_w(setpoint_c + LAGS_C, rate_c_per_s, 0.0) + transforming)


class ExcitationController:
    """Follows the temperature path of an excitation, with the nominal heat balance: the wire is not identified yet.

    The reading of the thermocouple counts as the temperature of the wire; the identification corrects its lag. The path
    waits while the wire is farther than `LAGS_C` from the path, so that every wire reaches every turning point.
    IdentificationError when a single wait lasts longer than `STALLS_S`.
    """

    def __init__(
        self,
        path_c: Callable[[float], float],
        duration_s: float,
        balance: HeatBalance,
        gains: PIGains,
        current_limit_a: float,
    ) -> None:
        self._path_c = path_c
        self._path_s = duration_s
        self._balance = balance
        self._feedback = TemperatureFeedback(gains)
        self._current_limit_a = current_limit_a
        self._last_reading_c = nan
        self._waited_s = self._stalled_s = 0.0

    @property
    def duration_s(self) -> float:
        """Duration of the path, plus the time that the path has waited so far, s."""
        return self._path_s + self._waited_s

    def update(self, time_s: float, measurement: Measurement, dt_s: float) -> Command:
        """Return the command that takes the wire to the temperature of the path at the end of the coming period.

        Until the first valid reading the path waits, and the current is zero.
        """
        reading_c = self._reading_c(measurement)
        if isnan(reading_c):
            self._waited_s += dt_s
            return Command(0.0, setpoint_c=self._path_c(0.0))
        self._wait(time_s, reading_c, dt_s)
        on_path_s = time_s - self._waited_s
        setpoint_c = self._path_c(on_path_s + dt_s)
        rate_c_per_s = (setpoint_c - self._path_c(on_path_s)) / dt_s
        feedforward_w = self._balance.power_w(setpoint_c, rate_c_per_s, 0.0)
        limit_w = self._current_limit_a**2 * self._balance.resistance_cold_ohm
        limit_w = min(limit_w, power_envelope_w(self._balance, setpoint_c, abs(rate_c_per_s)))
        power_w = self._feedback.update(setpoint_c - reading_c, feedforward_w, limit_w, dt_s)
        return Command(
            self._balance.current_a(power_w, 0.0), setpoint_c=setpoint_c, estimated_c=reading_c, power_w=power_w
        )

    def _wait(self, time_s: float, reading_c: float, dt_s: float) -> None:
        """Hold the path while the wire is farther than `LAGS_C` from the path."""
        path_c = self._path_c(time_s - self._waited_s)
        if abs(path_c - reading_c) <= LAGS_C:
            self._stalled_s = 0.0
            return
        self._waited_s += dt_s
        self._stalled_s += dt_s
        if self._stalled_s > STALLS_S:
            cure = (
                "if its calibration is right, too, lower high_c, or raise current_max_a if the data sheet allows it"
                if reading_c < path_c
                else "raise low_c or cool the surroundings"
            )
            raise IdentificationError(
                f"the wire did not reach {path_c:.1f} °C within {STALLS_S:g} s",
                where="excitation",
                value=f"{reading_c:.1f} °C",
                cure=f"check that the thermocouple sits on the wire; {cure}",
            )

    def _reading_c(self, measurement: Measurement) -> float:
        """Return the reading. In place of an invalid reading, return the last valid one, until the supervisor trips."""
        if isfinite(measurement.temperature_c):
            self._last_reading_c = measurement.temperature_c
        return self._last_reading_c
