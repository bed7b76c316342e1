"""Switching off tries every step although other steps fail, and waits until the measured current is zero."""

import errno
from functools import partial

import pytest

from firmware_sim.bench import simulated_device
from firmware_sim.config import load_sim
from smadrive.clock import VirtualClock
from smadrive.devices.device import Device
from smadrive.devices.heater import Heater
from smadrive.devices.heating.board import HeaterBoard
from smadrive.devices.heating.heat_source import HeaterLimits
from smadrive.devices.heating.supply import BenchSupply
from smadrive.devices.heating.tclab import TCLab
from smadrive.devices.heating.tclab_board import TCLabBoard
from smadrive.devices.heating.zero_current import confirm_off, wait_for_zero_current
from smadrive.devices.profile.profile import load_profile
from smadrive.devices.retry import PAUSES_S, WITHIN_S, retry_all
from smadrive.errors import DeadlineError, SafetyError, TakenOverError
from smadrive.modbus.client import ModbusClient

FAILURES = [OSError(errno.ENOSPC, "full"), BrokenPipeError(), MemoryError(), ValueError(), SafetyError("refused")]


@pytest.fixture
def hot(heater, run, rig):
    """A board that heats."""
    heater.connect()
    heater.arm(0.5)
    run(0.3, 0.5)
    assert rig.firmware.current_a > 0.0
    return heater


def failing(failure, counted):
    def step():
        counted.append(failure)
        raise failure

    return step


@pytest.mark.parametrize("failure", FAILURES, ids=lambda failure: type(failure).__name__)
@pytest.mark.parametrize("place", [0, 1])
def test_failed_step_does_not_prevent_the_others(hot, device, rig, clock, failure, place):
    counted = []
    steps = [partial(device.write, "heater_enable", 0)]
    steps.insert(place, failing(failure, counted))
    with pytest.raises(type(failure)) as caught:
        retry_all(steps, clock)
    assert caught.value is failure
    assert len(counted) == len(PAUSES_S) + 1
    assert rig.firmware.current_a == 0.0


@pytest.mark.parametrize(
    "error", [TakenOverError("the guardian has the line"), KeyboardInterrupt()], ids=lambda error: type(error).__name__
)
def test_take_over_and_interruption_end_the_attempts_at_once(clock, error):
    counted = []
    with pytest.raises(type(error)):
        retry_all([failing(error, counted)], clock)
    assert len(counted) == 1


@pytest.mark.parametrize("waits_s", [0.1, 3.0, 2.0 * WITHIN_S])
def test_silent_device_ends_the_tries_after_the_step_that_exceeds_their_time(clock, waits_s):
    begun = []

    def wait(name):
        begun.append(name)
        clock.sleep_until(clock.now_s() + waits_s)
        raise DeadlineError(name)

    with pytest.raises(DeadlineError) as error:
        retry_all([partial(wait, "output"), partial(wait, "current")], clock)
    assert begun[:2] == ["output", "current"]
    assert clock.now_s() < max(WITHIN_S, 2 * waits_s) + waits_s + sum(PAUSES_S)
    assert error.value.what in begun


def test_tries_that_end_in_a_round_without_a_failure_count_as_failed(clock):
    failures = [DeadlineError("no reply")]

    def fail_once():
        clock.sleep_until(clock.now_s() + WITHIN_S / 2)
        if failures:
            raise failures.pop()

    with pytest.raises(DeadlineError):
        retry_all([fail_once, fail_once], clock)


def test_device_busy_at_the_current_check_is_asked_again(hot, rig, clock):
    hot.source.enter_safe_state()
    rig.faults.refuse(code=6, replies=1)
    assert not wait_for_zero_current(hot.source, 0.6, clock).armed


def test_negative_current_counts_as_current(hot, clock, monkeypatch):
    hot.source.enter_safe_state()
    reversed_shunt = hot.source.exchange(0.0)._replace(current_a=-0.8)
    monkeypatch.setattr(hot.source, "exchange", lambda _current_a, **_options: reversed_shunt)
    with pytest.raises(SafetyError):
        wait_for_zero_current(hot.source, 0.6, clock)


@pytest.mark.parametrize("fails_from", [0, 1, 2, 5])
@pytest.mark.parametrize("fails_for", [1, 3])
def test_trace_that_fails_for_a_while_does_not_keep_the_heater_on(rig, clock, fails_from, fails_for):
    frames = []

    def trace(_time_s, _direction, _frame):
        frames.append(None)
        if armed and fails_from <= len(frames) - armed[0] < fails_from + fails_for:
            raise OSError(errno.ENOSPC, "full")

    armed = []
    device = Device(load_profile("sma-reference"), ModbusClient(rig.transport(clock), trace))
    heater = Heater(HeaterBoard(device, clock), HeaterLimits(0.6, 130.0), clock)
    heater.connect()
    heater.arm(0.5)
    heater.exchange(0.3)
    armed.append(len(frames))
    heater.enter_safe_state()
    assert rig.firmware.current_a == 0.0


def test_silent_device_raises_its_first_error(hot, rig):
    rig.faults.drop(10_000)
    with pytest.raises(DeadlineError):
        hot.enter_safe_state()


BUS_FAULTS = {
    "device busy": lambda faults: faults.refuse(code=6),
    "no reply behind the gateway": lambda faults: faults.refuse(code=11),
    "three damaged replies": lambda faults: faults.corrupt(replies=3),
}


@pytest.mark.parametrize("begin", BUS_FAULTS.values(), ids=BUS_FAULTS)
def test_failed_first_reading_of_the_identity_does_not_keep_a_supply_on(begin):
    supply, clock = simulated_device(load_sim("flexinol-lt-0.15mm"), 1, load_profile("riden-rd60xx")), VirtualClock()
    clock.follow(supply.bench.advance_to)
    before = Device(load_profile("riden-rd60xx"), ModbusClient(supply.transport(clock)))
    for name, value in (("v_set", 5.0), ("i_set", 0.3), ("output", 1)):
        before.write(name, value)
    clock.sleep_until(clock.now_s() + 1.0)
    assert supply.firmware.current_a > 0.1
    source = BenchSupply(Device(load_profile("riden-rd60xx"), ModbusClient(supply.transport(clock))))
    begin(supply.faults)
    assert not confirm_off(source, 0.4, clock).armed
    assert supply.firmware.current_a == 0.0


def test_damaged_banner_does_not_keep_a_tclab_on():
    profile = load_profile("tclab")
    board, clock = simulated_device(load_sim("flexinol-lt-0.15mm"), 1, profile), VirtualClock()
    clock.follow(board.bench.advance_to)
    clock.sleep_until(3.0)
    board.firmware.duty = {"Q1": 30.0, "Q2": 40.0}
    source = TCLab(TCLabBoard(profile, board.transport(clock)), full_scale_a=1.0, full_scale_v=16.5)
    board.faults.drop(for_s=profile.timing.patience_s + 1.0)
    confirm_off(source, 0.6, clock)
    assert board.firmware.duty == {"Q1": 0.0, "Q2": 0.0}
