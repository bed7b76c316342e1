"""The calibrations of a rig in one line each, as `calibrate` and `probe` print them."""

from __future__ import annotations

from datetime import date, datetime

from smadrive.devices.calibration import CalibrationConfig, DisplacementCalibration, TemperatureCalibration


def today() -> date:
    """Return the present date in the local time zone."""
    return datetime.now().astimezone().date()


def descriptions(config: CalibrationConfig, on: date) -> dict[str, str]:
    """Return one text for each sensor, by its name: offset, scale, and the age of the calibration on the day `on`."""
    return {sensor: f"{sensor} {_description(calibration, on)}" for sensor, calibration in config}


def _description(calibration: TemperatureCalibration | DisplacementCalibration | None, on: date) -> str:
    if calibration is None:
        return "not calibrated"
    days = (on - calibration.on).days
    age = {0: "today", 1: "yesterday"}.get(days, f"{days} days ago")
    return f"calibrated {age}: offset {_offset(calibration)}, scale {_scale(calibration)}"


def _offset(calibration: TemperatureCalibration | DisplacementCalibration) -> str:
    if isinstance(calibration, TemperatureCalibration):
        return f"{calibration.offset_c:+.2f} ± {calibration.offset_uncertainty_c:.2f} °C"
    return f"{calibration.offset_mm:+.4f} ± {calibration.offset_uncertainty_mm:.4f} mm"


def _scale(calibration: TemperatureCalibration | DisplacementCalibration) -> str:
    if calibration.scale_uncertainty is None:
        return f"{calibration.scale:.4f}"
    return f"{calibration.scale:.4f} ± {calibration.scale_uncertainty:.4f}"
