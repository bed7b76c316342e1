"""A calibrated sensor: its values are corrected everywhere, and a limit stays the limit of the wire."""

import math

import pytest

from smadrive.devices.calibration import UNCORRECTED, CalibrationConfig, Corrections, SensorCorrection
from smadrive.devices.heater import Heater
from smadrive.devices.heating.board import HeaterBoard
from smadrive.devices.heating.heat_source import HeaterLimits

LIMITS = HeaterLimits(current_max_a=0.6, temperature_max_c=130.0)


def calibrated(device, clock, temperature=UNCORRECTED.temperature, displacement=UNCORRECTED.displacement):
    return Heater(HeaterBoard(device, clock), LIMITS, clock, corrections=Corrections(temperature, displacement))


def test_values_are_corrected(device, clock, rig):
    measured = calibrated(device, clock, SensorCorrection(3.0, 0.9), SensorCorrection(-1.0, 2.0)).connect()
    assert measured.temperature_c == pytest.approx(0.9 * rig.bench.sensors.temperature_c + 3.0, abs=0.01)
    assert measured.displacement_mm == pytest.approx(2.0 * rig.bench.plant.displacement_mm - 1.0, abs=0.1)


def test_invalid_value_stays_invalid():
    assert math.isnan(SensorCorrection(3.0, 0.9).corrected(math.nan))


@pytest.mark.parametrize(
    ("correction", "limit_c"),
    [(SensorCorrection(10.0, 1.0), 120.0), (SensorCorrection(0.0, 1.25), 104.0), (SensorCorrection(-10.0, 1.0), 130.0)],
)
def test_device_switches_off_at_the_limit_of_the_wire_at_the_latest(device, clock, correction, limit_c):
    heater = calibrated(device, clock, correction)
    heater.connect()
    heater.arm(0.5)
    name = device.profile.role("temperature_max")
    assert device.read((name,))[name].value == pytest.approx(limit_c)


def test_current_ends_at_the_corrected_limit(device, clock, rig):
    heater = calibrated(device, clock, SensorCorrection(20.0, 1.25))
    heater.connect()
    heater.arm(0.5)
    for _ in range(400):
        clock.sleep_until(clock.now_s() + 0.05)
        heater.exchange(0.6)
    assert 1.25 * rig.bench.sensors.temperature_c + 20.0 < LIMITS.temperature_max_c


@pytest.mark.parametrize(
    "section",
    [
        {"temperature": {"offset_c": 40.0, "offset_uncertainty_c": 0.1, "on": "2026-01-01"}},
        {"temperature": {"offset_c": 0.0, "offset_uncertainty_c": 0.1, "scale": 0.1, "on": "2026-01-01"}},
        {"displacement": {"offset_mm": 0.0, "offset_uncertainty_mm": 0.1, "scale": -1.0, "on": "2026-01-01"}},
    ],
)
def test_calibration_of_no_working_sensor_is_refused(section):
    with pytest.raises(ValueError):
        CalibrationConfig.model_validate(section)
