"""The alarm of a reading names the fault that matters most."""

from math import nan

import pytest

from smadrive.bluesky.readings import WireSample, alarm_of
from smadrive.control.controllers.interface import Command
from smadrive.control.loop import Tick
from smadrive.measurement import Measurement

INVALID_TEMPERATURE = {"temperature_c": nan, "temperature_fault": "open"}
INVALID_SUPPLY = {"current_a": nan, "voltage_v": nan, "supply_fault": "asleep"}
DEVICE = {"device_faults": ("over_current",)}
LIMITED = {"device_limits": ("current",)}


@pytest.mark.parametrize(
    ("measured", "latched", "severity", "text"),
    [
        ({}, None, 0, ""),
        (LIMITED, None, 1, "current"),
        (LIMITED | DEVICE, None, 2, "over_current"),
        (LIMITED, "too hot", 2, "too hot"),
        (DEVICE, "too hot", 2, "too hot"),
        (DEVICE | INVALID_SUPPLY, "too hot", 3, "asleep"),
        (INVALID_SUPPLY | INVALID_TEMPERATURE, None, 3, "open"),
    ],
)
def test_alarm(measured, latched, severity, text):
    measurement = Measurement(**{"time_s": 0.0, "temperature_c": 20.0, "current_a": 0.1, "voltage_v": 1.0, **measured})
    alarm = alarm_of(WireSample(Tick(0.0, 0.0, measurement, Command(0.0)), 0.0, latched=latched))
    assert alarm.severity == severity
    assert text in alarm.text
