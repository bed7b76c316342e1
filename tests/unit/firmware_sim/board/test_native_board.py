"""The C core as a simulated device: conformance, the real driver, and the choice of the implementation."""

import re

import pytest

from firmware_sim.bench import SimulatedBench
from firmware_sim.board.build import Product, built
from firmware_sim.board.native_board import NativeBoard
from firmware_sim.devices.board.firmware import BoardFirmware
from smadrive.clock import VirtualClock
from smadrive.devices.device import Device
from smadrive.devices.heater import Heater
from smadrive.devices.heating.board import HeaterBoard
from smadrive.devices.heating.heat_source import HeaterLimits
from smadrive.devices.profile.profile import load_profile
from smadrive.errors import ConfigError
from smadrive.files.shipped import configs_dir
from smadrive.modbus.client import ModbusClient

DOCUMENT = (configs_dir().parent / "docs" / "sma-reference.md").read_text(encoding="utf-8")
DIALOGUE = re.findall(r"^\| ((?:[0-9A-F]{2} )+[0-9A-F]{2}) \| ((?:[0-9A-F]{2} ?)+) \|", DOCUMENT, re.MULTILINE)
TICK_S = 0.05


@pytest.fixture
def native(config):
    board = config.board.model_copy(update={"implementation": "native"})
    return config.model_copy(update={"board": board})


@pytest.fixture
def device(native):
    return SimulatedBench(native, seed=1).attach(load_profile("sma-reference"))


@pytest.fixture
def clock(device):
    clock = VirtualClock()
    clock.follow(device.bench.advance_to)
    return clock


@pytest.fixture
def heater(device, clock):
    client = ModbusClient(device.transport(clock))
    source = HeaterBoard(Device(device.profile, client), clock)
    return Heater(source, HeaterLimits(current_max_a=0.6, temperature_max_c=130.0), clock)


def test_native_board_answers_like_the_documented_dialogue(device):
    assert isinstance(device.firmware, NativeBoard)
    for request, reply in DIALOGUE:
        ((_, answer),) = device.line.receive(bytes.fromhex(request), 0.0)
        assert answer.hex(" ").upper() == reply, request


def test_driver_heats_a_wire_with_the_native_board_and_a_fault_ends_it(heater, device, clock):
    heater.connect()
    heater.arm(watchdog_s=0.5)

    def run(duration_s):
        measured = []
        for _ in range(round(duration_s / TICK_S)):
            clock.sleep_until(clock.now_s() + TICK_S)
            measured.append(heater.exchange(0.3))
        return measured

    warm = run(2.0)[-1]
    assert warm.armed
    assert warm.temperature_c > 30.0
    assert device.firmware.current_a == pytest.approx(0.3)
    device.bench.sensors.faults.press_estop()
    stopped = run(0.1)[-1]
    assert not stopped.armed
    assert stopped.device_faults == ("estop",)
    assert device.firmware.current_a == 0.0
    assert any("estop" in event for event in device.bench.events)


def test_watchdog_and_power_cycle_of_the_native_board_end_the_heat(heater, device, clock):
    heater.connect()
    heater.arm(watchdog_s=0.5)
    heater.exchange(0.3)
    clock.sleep_until(clock.now_s() + 1.0)
    assert device.firmware.current_a == 0.0
    device.power_cycle()
    assert not heater.exchange(0.3).armed


def test_python_is_the_default_and_serves_both_versions(config):
    for name, version in (("sma-reference", 2), ("sma-reference:map_version=1", 1)):
        device = SimulatedBench(config, seed=1).attach(load_profile(name))
        assert isinstance(device.firmware, BoardFirmware)
        ((_, reply),) = device.line.receive(bytes.fromhex("01 03 00 01 00 01 D5 CA"), 0.0)
        assert reply[4] == version


def test_native_board_of_version_1_is_a_config_error(native):
    with pytest.raises(ConfigError) as error:
        SimulatedBench(native).attach(load_profile("sma-reference:map_version=1"))
    assert "sma-reference" in error.value.where


def test_cache_folder_that_cannot_be_made_is_an_error(tmp_path, monkeypatch):
    (tmp_path / "cache").write_text("a file")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    with pytest.raises(ConfigError) as refused:
        built(Product("board.so", "the board", tmp_path, (tmp_path,), lambda: None))
    assert refused.value.where == str(tmp_path / "cache" / "smadrive")
