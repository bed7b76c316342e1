"""The TCLab driver with its simulated firmware. The board repeats every duty, and gives every temperature twice."""

from itertools import cycle
from math import isnan, sqrt

import pytest
from marks import exhaustive

from firmware_sim.bench import simulated_device
from firmware_sim.config import load_sim
from firmware_sim.fault_script import FaultScript
from smadrive.clock import VirtualClock
from smadrive.devices.heating.heat_source import HeaterLimits
from smadrive.devices.heating.tclab import TCLab
from smadrive.devices.heating.tclab_board import AGREE_C, TCLabBoard
from smadrive.devices.heating.zero_current import confirm_off
from smadrive.devices.profile.profile import load_profile
from smadrive.errors import (
    ConfigError,
    DeadlineError,
    DeviceError,
    IdentityError,
    ProtocolError,
    ReadBackError,
    SafetyError,
    TransportError,
)

PROFILE = load_profile("tclab")
LIMITS = HeaterLimits(current_max_a=0.6, temperature_max_c=130.0)
STEP_C = 0.33
"""One step of the temperature converter, in °C."""


@pytest.fixture
def device():
    return simulated_device(load_sim("flexinol-lt-0.15mm"), seed=1, profile=PROFILE)


@pytest.fixture
def clock(device):
    clock = VirtualClock()
    clock.follow(device.bench.advance_to)
    return clock


@pytest.fixture
def board(device, clock):
    return TCLabBoard(PROFILE, device.transport(clock))


@pytest.fixture
def source(board):
    return TCLab(board, full_scale_a=1.0, full_scale_v=16.5)


@pytest.fixture
def armed(source):
    source.connect()
    source.configure(LIMITS, 0.5)
    source.arm()
    return source


def wait(clock, seconds):
    clock.sleep_until(clock.now_s() + seconds)


@pytest.mark.parametrize("current_a", [0.08, 0.1, 0.25, 0.5, 0.6])
def test_the_heat_is_that_of_the_commanded_current(device, clock, armed, current_a):
    armed.exchange(current_a)
    wait(clock, 0.05)
    plant = device.bench.plant
    step_a = 1.0 / sqrt(200) if current_a < 0.1 else 0.02
    assert current_a - step_a <= plant.current_a <= current_a + 1e-9
    supplied = armed.exchange(current_a)
    assert supplied.armed
    assert supplied.current_a == pytest.approx(plant.current_a, rel=0.01)
    assert supplied.voltage_v == pytest.approx(plant.voltage_v, rel=0.01)
    assert supplied.temperature.value == pytest.approx(device.bench.sensors.temperature_c, abs=STEP_C)


def test_full_scale_and_zero_are_exact(device, clock, armed):
    armed.exchange(1.0)
    assert device.firmware.duty["Q1"] == 100.0
    armed.exchange(0.0)
    assert device.firmware.current_a == 0.0


def test_coarse_pulse_width_is_reported_as_a_limit(armed):
    assert armed.exchange(0.05).limits == ("pulse_width_step",)
    assert armed.exchange(0.5).limits == ()


def test_nothing_heats_before_arming_and_after_the_safe_state(device, source):
    source.connect()
    assert not source.exchange(0.5).armed
    assert device.firmware.current_a == 0.0
    source.arm()
    source.exchange(0.5)
    assert device.firmware.current_a > 0.4
    source.enter_safe_state()
    assert device.firmware.current_a == 0.0
    assert not source.exchange(0.5).armed


def test_the_safe_state_ends_both_heaters(device, source):
    device.firmware.duty = {"Q1": 30.0, "Q2": 40.0}
    source.connect()
    assert device.firmware.duty == {"Q1": 0.0, "Q2": 0.0}


def test_limits_that_the_board_cannot_keep_are_refused(source):
    source.connect()
    with pytest.raises(ConfigError) as current:
        source.configure(HeaterLimits(2.0, 130.0), 0.5)
    assert (current.value.where, current.value.value) == ("current_max_a", "2 A")
    assert current.value.limit == "full_scale_a = 1 A"
    with pytest.raises(ConfigError) as voltage:
        source.configure(HeaterLimits(0.6, 130.0, 9.0), 0.5)
    assert (voltage.value.where, voltage.value.value) == ("voltage_max_v", "9 V")
    assert voltage.value.limit == "full_scale_v = 16.5 V"


def test_a_board_that_heats_already_is_not_armed(device, source):
    source.connect()
    device.firmware.duty["Q1"] = 5.0
    with pytest.raises(SafetyError) as error:
        source.arm()
    assert error.value.value == "5 % duty"


def test_restart_of_the_board_is_detected_before_the_next_command(device, clock, armed):
    armed.exchange(0.5)
    device.firmware.restart()
    with pytest.raises(ReadBackError) as error:
        armed.exchange(0.5)
    assert error.value.value == "0 %, commanded 25.1 %"
    assert not armed.armed
    assert device.firmware.current_a == 0.0


@pytest.mark.parametrize(("fault", "shown"), [("open_thermocouple", "-50.0"), ("short_thermocouple", "279.7")])
def test_a_sensor_at_the_end_of_its_converter_is_no_temperature(device, clock, armed, fault, shown):
    getattr(device.bench.sensors.faults, fault)()
    wait(clock, 0.05)
    sample = armed.exchange(0.0).temperature
    assert isnan(sample.value)
    assert sample.problem == f"{shown} °C is outside the range: the sensor is open or shorted"


@pytest.fixture
def damage(device, monkeypatch):
    """Change the first digit of the next reply to a command. Nothing in the line reveals that."""
    right, damaged = device.firmware.answer, []

    def answer(line):
        said = right(line)
        if line in damaged:
            damaged.remove(line)
            return bytes((said[0] ^ 1,)) + said[1:]
        return said

    monkeypatch.setattr(device.responder, "answer", answer)
    return damaged.append


def test_damaged_temperature_is_rejected(armed, damage):
    damage(b"T1")
    with pytest.raises(ProtocolError) as error:
        armed.exchange(0.3)
    assert error.value.where.endswith("'T1'")
    first, second = (float(text) for text in error.value.value.split(", then "))
    assert first - second == pytest.approx(10.0, abs=AGREE_C)
    assert armed.exchange(0.3).armed


@pytest.fixture
def loosen(device, monkeypatch):
    """Call it to give the temperature sensor a loose contact: no two readings agree."""
    right, readings_c = device.firmware.answer, cycle((20.0, 90.0))

    def answer(line):
        return f"{next(readings_c):.3f}".encode() if line == b"T1" else right(line)

    return lambda: monkeypatch.setattr(device.responder, "answer", answer)


def test_sensor_with_a_loose_contact_does_not_keep_the_heater_on(device, armed, loosen):
    armed.exchange(0.3)
    loosen()
    with pytest.raises(ProtocolError):
        armed.exchange(0.3)
    sample = armed.exchange(0.0).temperature
    assert device.firmware.duty["Q1"] == 0.0
    assert isnan(sample.value)
    assert "T1" in sample.problem


def test_board_is_confirmed_off_by_its_duties_without_a_temperature(device, clock, armed, loosen):
    armed.exchange(0.3)
    loosen()
    off = confirm_off(armed, LIMITS.current_max_a, clock)
    assert (off.current_a, off.armed) == (0.0, False)
    assert device.firmware.duty["Q1"] == 0.0


def test_a_damaged_echo_of_the_duty_is_read_back(device, armed, damage):
    damage(b"Q1 9.10")
    armed.exchange(0.3)
    assert device.firmware.duty["Q1"] == 9.1
    damage(b"R1")
    assert armed.exchange(0.3).current_a == pytest.approx(0.3)


def test_damaged_command_raises_a_read_back_error(device, armed, monkeypatch):
    right = device.firmware.answer
    monkeypatch.setattr(device.responder, "answer", lambda line: right(line.replace(b"Q1 9.10", b"Q1 99.10")))
    with pytest.raises(ReadBackError) as error:
        armed.exchange(0.3)
    assert error.value.where.endswith("heater 1")
    assert error.value.value == "99.1 %, set to 9.1 %"
    armed.enter_safe_state()
    assert device.firmware.current_a == 0.0


def test_lost_echo_leaves_two_possible_duties(device, armed):
    for _ in range(3):
        device.faults.delay(1e-4)
    device.faults.drop()
    with pytest.raises(DeadlineError):
        armed.exchange(0.3)
    assert armed.exchange(0.2).current_a == pytest.approx(0.3)


@pytest.mark.parametrize(
    "banner", ["TCLab Firmware 1.3.0 Arduino Uno", "TCLab Firmware 2.0.1", "Grbl 1.1h ['$' for help]", ""]
)
def test_device_that_is_no_tclab_gets_no_command(device, board, monkeypatch, banner):
    heard = []

    def answer(line):
        heard.append(line)
        return banner.encode()

    monkeypatch.setattr(device.responder, "answer", answer)
    with pytest.raises((IdentityError, DeadlineError)):
        board.heat(1, 10.0)
    assert set(heard) == {b"VER"}


def test_a_board_that_starts_is_waited_for(clock, board):
    board.check_identity()
    assert PROFILE.timing.boot_ms / 1e3 - 0.5 < clock.now_s() < PROFILE.timing.boot_ms / 1e3 + 0.5


@pytest.mark.parametrize("seed", [0, *map(exhaustive, (1, 2))])
def test_bad_line_gives_no_wrong_value(seed):
    """Every failure has an error type, every accepted value is right, and the heater is always off at the end."""
    device = simulated_device(load_sim("flexinol-lt-0.15mm"), seed, PROFILE)
    clock = VirtualClock()
    clock.follow(device.bench.advance_to)
    source = TCLab(TCLabBoard(PROFILE, device.transport(clock)), 1.0, 16.5)
    source.connect()
    device.bench.follow_script(FaultScript.model_validate({"random": {"share": 0.1, "slowest_s": 0.4}}))
    right = failed = 0
    for number in range(1500):
        wait(clock, 0.05)
        if not source.armed:
            try:
                source.enter_safe_state()
                source.arm()
            except (TransportError, ProtocolError, DeviceError, SafetyError):
                continue
        duty = device.firmware.duty["Q1"]
        before_c = device.bench.sensors.temperature_c
        try:
            supplied = source.exchange(0.1 + 0.1 * (number % 3))
        except (TransportError, ProtocolError, DeviceError):
            failed += 1
            continue
        right += 1
        assert supplied.current_a == pytest.approx(sqrt(int(duty * 2) / 200))
        now_c = device.bench.sensors.temperature_c
        low_c, high_c = sorted((before_c, now_c))
        assert low_c - AGREE_C - STEP_C <= supplied.temperature.value <= high_c + AGREE_C + STEP_C
        assert source._may_be == (device.firmware.duty["Q1"],)
    assert right > 500
    assert failed > 100
    device.faults.before_reply = lambda: None
    device.faults.clear()
    wait(clock, 5.0)
    source.enter_safe_state()
    assert device.firmware.current_a == 0.0


@pytest.mark.parametrize("text", ["nan", "inf", "-inf"])
def test_duty_that_is_not_finite_is_zero(device, text):
    device.firmware.answer(b"Q1 50")
    device.firmware.answer(f"Q1 {text}".encode())
    assert device.firmware.duty["Q1"] == 0.0
    assert device.firmware.current_a == 0.0
