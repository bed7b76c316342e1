"""The prediction of a displacement from heater power and thermocouple alone, without any measured displacement."""

from __future__ import annotations

from math import isfinite, nan

from smadrive.control.estimation.observer import WireObserver
from smadrive.control.estimation.wire_estimate import WireEstimate
from smadrive.measurement import Measurement
from smadrive.wire.wire_model import WireModel

ABSURD = 2.0
"""A measured current above this multiple of its limit is wrong; the supervisor trips if it lasts."""


def heating_w(measurement: Measurement, wire: WireModel, before: WireEstimate, limit_a: float) -> float:
    """Return the power that has heated the wire since the estimate `before`, in W.

    It is the measured power. If this power is unknown, or the measured current is absurd for the limit `limit_a`, it is
    the power of the commanded current.
    """
    power_w = measurement.current_a * measurement.voltage_v
    if isfinite(power_w) and measurement.current_a <= ABSURD * limit_a:
        return power_w
    return measurement.in_force_a**2 * wire.resistance_ohm(before.hysteresis, before.temperature_c)


class DisplacementPrediction:
    """Predicts the displacement of a wire, as the controller estimates it in a run without a source of displacement.

    `limit_a` is the largest current of the rig.
    """

    def __init__(self, wire: WireModel, observer: WireObserver, limit_a: float) -> None:
        self._wire, self._observer, self._limit_a = wire, observer, limit_a
        self._estimate: WireEstimate | None = None

    def update(self, _time_s: float, measurement: Measurement, dt_s: float) -> float:
        """Return the predicted displacement in mm; NaN until the first reading of the temperature.

        `dt_s` is the time since the last measurement. The measured displacement has no influence.
        """
        reading_c = measurement.temperature_c
        if self._estimate is not None:
            power_w = heating_w(measurement, self._wire, self._estimate, self._limit_a)
            self._estimate = self._observer.update(self._estimate, reading_c, nan, power_w, dt_s)
        elif isfinite(reading_c):
            self._estimate = self._observer.start(reading_c, nan)
        return nan if self._estimate is None else self._estimate.hysteresis.y
