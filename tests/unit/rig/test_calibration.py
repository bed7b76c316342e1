"""The reading of a sensor at a known value, and the calibration in the rig file."""

import tomllib
from datetime import date

import pytest

from firmware_sim.bench import simulated_device
from firmware_sim.config import load_sim
from smadrive.clock import VirtualClock
from smadrive.errors import ConfigError, DataError
from smadrive.files.shipped import configs_dir
from smadrive.rig.calibration.description import descriptions
from smadrive.rig.calibration.reading import read_steadily
from smadrive.rig.calibration.rig_file import check_own_file, store_calibration
from smadrive.rig.config import RigConfig, load_rig
from smadrive.rig.rig import Rig

SHIPPED = configs_dir() / "rigs" / "in-process.toml"
SECTION = {"offset_c": -0.8, "offset_uncertainty_c": 0.2, "scale": 1.01, "on": date(2026, 1, 1), "evidence": "ice"}


@pytest.fixture
def device():
    return simulated_device(load_sim("flexinol-lt-0.15mm"), seed=2)


@pytest.fixture
def rig(device):
    clock = VirtualClock()
    clock.follow(device.bench.advance_to)
    with Rig(load_rig("in-process"), None, {"board": device.transport(clock)}) as rig:
        yield rig


@pytest.fixture
def own_file(tmp_path):
    path = tmp_path / "rig.toml"
    path.write_text(SHIPPED.read_text())
    return path


def test_reading_is_the_mean_with_its_uncertainty(rig, device):
    reading = read_steadily(rig, "temperature", 20.0)
    assert reading.samples == 400
    assert reading.mean == pytest.approx(device.bench.plant.temperature_c, abs=4 * reading.uncertainty)
    assert 0.0 < reading.uncertainty < 0.05


def test_reading_of_a_slow_sensor_counts_once():
    text = (configs_dir() / "rigs" / "bench-supply.toml").read_text()
    for number in range(3):
        text = text.replace(f"serial:///dev/ttyUSB{number}", "sim://flexinol-lt-0.15mm")
    config = RigConfig.model_validate(tomllib.loads(text))
    slow = tuple(device.model_copy(update={"rate_hz": 1.0}) for device in config.devices[1:])
    with Rig(config.model_copy(update={"devices": (config.devices[0], *slow)})) as rig:
        assert 9 <= read_steadily(rig, "temperature", 10.0).samples <= 11


@pytest.mark.parametrize("quantity", ["temperature", "displacement"])
def test_sensor_that_drifts_or_is_broken_is_refused(rig, device, quantity):
    sensor = getattr(device.bench.sensors.faults, quantity if quantity == "displacement" else "thermocouple")
    sensor.begin("drift", None, lambda r, age_s: r.right + 0.2 * age_s)
    with pytest.raises(DataError) as error:
        read_steadily(rig, quantity, 10.0)
    assert "steady" in error.value.what
    sensor.begin("open", None, lambda _r, _age_s: float("nan"))
    with pytest.raises(DataError):
        read_steadily(rig, quantity, 10.0)


def test_stored_calibration_is_in_force_and_leaves_the_comments(own_file):
    store_calibration(own_file, "temperature", SECTION | {"offset_c": 5.0})
    store_calibration(own_file, "temperature", SECTION)
    text = own_file.read_text()
    assert text.startswith(SHIPPED.read_text())
    assert tomllib.loads(text)["calibration"] == {"temperature": SECTION}
    assert load_rig(str(own_file)).calibration.corrections().temperature == (-0.8, 1.01)


def test_mistaken_calibration_leaves_the_file(own_file):
    with pytest.raises(ConfigError):
        store_calibration(own_file, "temperature", SECTION | {"offset_c": 78.0})
    assert own_file.read_text() == SHIPPED.read_text()


def test_shipped_rig_is_not_changed(own_file):
    check_own_file(own_file)
    with pytest.raises(ConfigError):
        check_own_file(SHIPPED)


@pytest.mark.parametrize(("day", "age"), [(1, "today"), (2, "yesterday"), (31, "30 days ago")])
def test_description_says_the_age(own_file, day, age):
    store_calibration(own_file, "temperature", SECTION)
    lines = descriptions(load_rig(str(own_file)).calibration, date(2026, 1, day))
    assert f"calibrated {age}" in lines["temperature"]
    assert lines["displacement"] == "displacement not calibrated"
