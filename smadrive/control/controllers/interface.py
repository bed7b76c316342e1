"""The interface of every controller: one command for each measurement.

A controller returns its setpoints and estimates together with the current, so that they can be recorded and shown.
"""

from __future__ import annotations

from math import nan
from typing import NamedTuple, Protocol

from smadrive.measurement import Measurement


class Command(NamedTuple):
    """The commanded heater current, with setpoints, estimates and power. A value is NaN if the controller has none.

    commanded_a           heater current, A
    setpoint_c            temperature setpoint, °C
    setpoint_mm           displacement setpoint, mm
    estimated_c           estimated temperature of the wire, °C
    estimated_mm          estimated displacement, mm
    power_w               power of this current, W
    cooling               estimated heat loss, divided by the loss of the heat balance: more than 1 in a draft
    shift_c               estimated shift of the transformation by a changed load, K
    by_resistance_mm      displacement by the resistance of the wire, mm
    by_resistance_sd_mm   standard deviation of the displacement by the resistance, mm
    uses_resistance       1 while the resistance is the source of the displacement, otherwise 0
    sensor_replaced       1 while the displacement sensor is not the source because its readings are wrong or missing
    resistance_wrong      1 while the resistance contradicts the displacement sensor, which is used, otherwise 0
    """

    commanded_a: float
    setpoint_c: float = nan
    setpoint_mm: float = nan
    estimated_c: float = nan
    estimated_mm: float = nan
    power_w: float = nan
    cooling: float = nan
    shift_c: float = nan
    by_resistance_mm: float = nan
    by_resistance_sd_mm: float = nan
    uses_resistance: float = 0.0
    sensor_replaced: float = 0.0
    resistance_wrong: float = 0.0

    def after_trip(self) -> Command:
        """Return the command of the measurement that trips after this command: the same, but without current."""
        return self._replace(commanded_a=0.0, power_w=0.0 * self.power_w)  # a power that is NaN stays NaN


class Controller(Protocol):
    """Computes one command from each measurement."""

    @property
    def duration_s(self) -> float:
        """Duration of the run in s, from the start of the loop. It grows while the path of an excitation waits."""
        ...

    def update(self, time_s: float, measurement: Measurement, dt_s: float) -> Command:
        """Return the next command. `time_s` counts from the start of the loop, `dt_s` from the last update, in s."""
        ...
