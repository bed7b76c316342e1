"""The calibration of the sensors, as a rig file stores it, and the correction of their readings.

value = scale * reading + offset. Offset and scale must lie within the limits of a working sensor: a mistaken number
must not make a hot wire look cold.
"""

from __future__ import annotations

from datetime import date
from typing import ClassVar, NamedTuple

from pydantic import Field

from smadrive.files.config import Section


class SensorCorrection(NamedTuple):
    """The straight line that converts the reading of a sensor to a value. The default leaves the reading unchanged."""

    offset: float = 0.0
    scale: float = 1.0

    def corrected(self, reading: float) -> float:
        """Return the value for a reading of the sensor. An invalid reading (NaN) stays NaN."""
        return self.scale * reading + self.offset

    def reading_at(self, value: float) -> float:
        """Return the reading that the sensor gives when the true value is `value`."""
        return (value - self.offset) / self.scale


class Corrections(NamedTuple):
    """The corrections of the two sensors of a wire."""

    temperature: SensorCorrection = SensorCorrection()
    displacement: SensorCorrection = SensorCorrection()


UNCORRECTED = Corrections()


class SensorCalibration(Section):
    """The common fields of the two calibrations. Every uncertainty is expanded (k = 2).

    scale_uncertainty    uncertainty of the scale; None if it is unknown
    on                   date of the calibration
    evidence             the measured points, as text
    """

    source_of_keys: ClassVar[str] = "`smadrive calibrate` writes this table"

    scale_uncertainty: float | None = Field(default=None, ge=0)
    on: date
    evidence: str = ""


class TemperatureCalibration(SensorCalibration):
    """The calibration of the thermocouple."""

    offset_c: float = Field(ge=-20, le=20)
    offset_uncertainty_c: float = Field(ge=0)
    scale: float = Field(default=1.0, ge=0.8, le=1.25)

    def correction(self) -> SensorCorrection:
        """Return the straight line that corrects the readings of the thermocouple in °C."""
        return SensorCorrection(self.offset_c, self.scale)


class DisplacementCalibration(SensorCalibration):
    """The calibration of the displacement sensor."""

    offset_mm: float = Field(ge=-1000, le=1000)
    offset_uncertainty_mm: float = Field(ge=0)
    scale: float = Field(default=1.0, ge=0.5, le=2)

    def correction(self) -> SensorCorrection:
        """Return the straight line that corrects the readings of the displacement sensor in mm."""
        return SensorCorrection(self.offset_mm, self.scale)


class CalibrationConfig(Section):
    """The calibrations of a rig. The readings of a sensor without a calibration are not corrected."""

    temperature: TemperatureCalibration | None = None
    displacement: DisplacementCalibration | None = None

    def corrections(self) -> Corrections:
        """Return the corrections of both sensors."""
        none = SensorCorrection()
        return Corrections(
            *(none if one is None else one.correction() for one in (self.temperature, self.displacement))
        )
