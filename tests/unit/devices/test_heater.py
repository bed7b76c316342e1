"""`Heater.exchange`: limits, arming, stale values and faults. Driver and rig run in virtual time."""

import errno
import math

import pytest

from firmware_sim.bench import simulated_device
from firmware_sim.config import load_sim
from smadrive.clock import VirtualClock
from smadrive.devices.device import Device
from smadrive.devices.heater import Heater
from smadrive.devices.heating.board import SEQUENCES, HeaterBoard
from smadrive.devices.heating.heat_source import HeaterLimits
from smadrive.devices.profile.profile import load_profile
from smadrive.errors import (
    ConfigError,
    DeadlineError,
    ExceptionReply,
    ProtocolError,
    SafetyError,
)
from smadrive.modbus.client import ModbusClient
from smadrive.modbus.framing import rtu
from smadrive.modbus.transports.in_process import InProcessTransport

LIMITS = HeaterLimits(current_max_a=0.6, temperature_max_c=130.0)


def test_heater_heats_only_when_armed(heater, run, rig):
    heater.connect()
    assert not run(0.3, 0.2)[-1].armed
    assert rig.firmware.current_a == 0.0
    heater.arm(0.5)
    assert run(0.3, 1.0)[-1].armed
    assert rig.firmware.current_a == pytest.approx(0.3)


def test_measurement_has_the_values_of_the_bench(heater, run, rig, clock):
    heater.connect()
    heater.arm(0.5)
    last = run(0.35, 1.5)[-1]
    assert last.time_s == clock.now_s()
    assert last.current_a == pytest.approx(0.35, abs=0.002)
    assert last.voltage_v == pytest.approx(0.35 * rig.bench.plant.resistance_ohm, abs=0.02)
    assert last.displacement_mm == pytest.approx(rig.bench.plant.displacement_mm, abs=0.06)
    assert last.temperature_c == pytest.approx(rig.bench.sensors.temperature_c, abs=0.01)
    assert last.temperature_fault is None
    assert last.device_faults == last.device_limits == ()


def test_a_tick_is_one_transaction(heater, run, device):
    heater.connect()
    before = device.client.counters.requests
    run(0.0, 1.0)
    assert device.client.counters.requests == before + 20


@pytest.mark.parametrize(("asked_a", "limits"), [(0.59, ()), (0.6 - 1e-15, ("current_max",)), (9.9, ("current_max",))])
def test_command_at_the_limit_is_reported_as_limited(heater, run, asked_a, limits):
    heater.connect()
    heater.arm(0.5)
    assert run(asked_a, 0.2)[-1].host_limits == limits


@pytest.mark.parametrize(("asked_a", "given_a"), [(9.9, 0.6), (-1.0, 0.0), (1e300, 0.6), (0.1234, 0.1234)])
def test_the_current_is_held_to_the_limits(heater, run, rig, asked_a, given_a):
    heater.connect()
    heater.arm(0.5)
    run(asked_a, 0.05)
    assert rig.firmware.commanded_a == pytest.approx(given_a)


@pytest.mark.parametrize("command", [math.nan, math.inf, -math.inf])
def test_a_current_that_is_no_number_is_sent_as_zero_and_refused(heater, run, rig, command):
    heater.connect()
    heater.arm(0.5)
    run(0.3, 0.2)
    with pytest.raises(SafetyError) as error:
        heater.exchange(command)
    assert error.value.where == "current_a"
    assert rig.firmware.commanded_a == 0.0


def test_arming_sets_watchdog_and_limits_on_the_device(heater, rig):
    heater.connect()
    heater.arm(0.2)
    assert rig.firmware.watchdog_s == 0.2
    assert rig.firmware.temperature_max_c == 130.0
    assert rig.firmware.current_max_a == 0.6


def test_a_watchdog_that_the_device_cannot_have_is_refused(heater, rig):
    heater.connect()
    with pytest.raises(ConfigError) as error:
        heater.arm(60.0)
    assert (error.value.where, error.value.limit) == ("register 'watchdog_s'", "0.05 to 10")
    assert rig.firmware.state == 0


def test_limits_above_the_boards_own_are_refused(device, clock):
    heater = Heater(HeaterBoard(device, clock), HeaterLimits(current_max_a=0.5, temperature_max_c=200.0), clock)
    heater.connect()
    with pytest.raises(ExceptionReply) as error:
        heater.arm(0.5)
    assert error.value.where.endswith("register 'temperature_max' = 200 degC")


@pytest.mark.parametrize(("current", "temperature"), [(0.0, 100.0), (-1.0, 100.0), (math.nan, 100.0), (1.0, math.inf)])
def test_limits_without_effect_are_refused(current, temperature):
    with pytest.raises(ConfigError):
        HeaterLimits(current_max_a=current, temperature_max_c=temperature)


def test_silence_of_the_driver_turns_the_heater_off(heater, run, rig, clock):
    heater.connect()
    heater.arm(0.5)
    run(0.3, 1.0)
    clock.sleep_until(clock.now_s() + 0.6)
    assert rig.firmware.current_a == 0.0
    after = heater.exchange(0.3)
    assert after.device_faults == ("watchdog",)
    assert not after.armed
    assert not heater.source.armed


def test_a_fault_needs_an_explicit_clear_and_a_new_arming(heater, run, rig, clock):
    heater.connect()
    heater.arm(0.5)
    clock.sleep_until(clock.now_s() + 1.0)
    with pytest.raises(SafetyError) as error:
        heater.arm(0.5)
    assert error.value.value == "watchdog"
    assert heater.clear_faults().device_faults == ()
    run(0.3, 0.2)
    assert rig.firmware.current_a == 0.0
    heater.arm(0.5)
    run(0.3, 0.2)
    assert rig.firmware.current_a == pytest.approx(0.3)


def test_a_cause_that_persists_cannot_be_cleared(heater, rig):
    heater.connect()
    rig.bench.sensors.faults.short_thermocouple()
    rig.bench.advance_to(rig.bench.time_s + 0.1)
    with pytest.raises(SafetyError) as error:
        heater.clear_faults()
    assert error.value.value == "thermocouple_short"


@pytest.mark.parametrize(
    ("fail", "name"), [("open_thermocouple", "thermocouple_open"), ("short_thermocouple", "thermocouple_short")]
)
def test_a_dead_thermocouple_has_no_temperature_and_no_heat(heater, run, rig, fail, name):
    heater.connect()
    heater.arm(0.5)
    run(0.3, 0.5)
    getattr(rig.bench.sensors.faults, fail)()
    last = run(0.3, 0.1)[-1]
    assert math.isnan(last.temperature_c)
    assert last.temperature_fault == name
    assert last.device_faults == (name,)
    assert rig.firmware.current_a == 0.0


def test_the_host_heats_no_further_at_its_maximum(device, clock, rig):
    rig.bench.plant.temperature_c = 99.0
    heater = Heater(HeaterBoard(device, clock), HeaterLimits(current_max_a=0.6, temperature_max_c=100.0), clock)
    heater.connect()
    rig.bench.plant.temperature_c = 140.0
    rig.bench.advance_to(rig.bench.time_s + 1.0)
    with pytest.raises(SafetyError) as error:
        heater.arm(0.5)
    assert float(error.value.value.removesuffix(" °C")) > 100.0
    assert error.value.limit == "100 °C"


def test_frozen_converter_makes_the_temperature_invalid(heater, run, rig):
    heater.connect()
    heater.arm(0.5)
    run(0.2, 0.5)
    rig.bench.sensors.faults.stop_conversions()
    last = run(0.2, 0.7)[-1]
    assert math.isnan(last.temperature_c)
    assert "no new conversion for 0.7" in last.temperature_fault
    assert run(0.2, 0.05)[-1].host_limits == ("temperature",)
    assert rig.firmware.commanded_a == 0.0
    assert run(0.0, 0.05)[-1].host_limits == ()


def test_restarted_device_is_not_heated(heater, run, rig):
    heater.connect()
    heater.arm(0.5)
    run(0.3, 0.5)
    rig.power_cycle()
    last = run(0.3, 0.2)[-1]
    assert not last.armed
    assert not heater.source.armed
    assert rig.firmware.current_a == 0.0


def test_a_lost_reply_costs_one_tick_and_heating_goes_on(heater, run, rig, clock):
    heater.connect()
    heater.arm(0.5)
    run(0.3, 0.5)
    rig.faults.drop()
    with pytest.raises(DeadlineError):
        heater.exchange(0.3)
    clock.sleep_until(clock.now_s() + 0.05)
    assert run(0.3, 0.5)[-1].armed


def test_stale_exchange_is_rejected_by_its_sequence_number(heater, run, rig):
    """The device answers with an old block of values, like a gateway with a cache."""
    heater.connect()
    heater.arm(0.5)
    run(0.3, 0.2)
    rig.faults.stale()
    with pytest.raises(ProtocolError) as error:
        heater.exchange(0.3)
    assert error.value.where == "unit 1"
    run(0.3, 0.05)
    assert rig.firmware.commanded_a == 0.0  # the temperature is unknown, so this tick has no heat
    run(0.3, 0.05)
    assert rig.firmware.commanded_a == pytest.approx(0.3)


@pytest.mark.exhaustive
def test_trace_that_fails_at_any_frame_does_not_stop_the_safe_state():
    failing = 0
    while True:
        clock = VirtualClock()
        rig = simulated_device(load_sim("flexinol-lt-0.15mm"), seed=1)
        clock.follow(rig.bench.advance_to)
        seen = []

        def trace(*event, seen=seen, failing=failing):
            seen.append(event)
            if len(seen) > failing:
                raise OSError(errno.ENOSPC, "No space left on device")

        client = ModbusClient(rig.transport(clock), trace)
        heater = Heater(HeaterBoard(Device(load_profile("sma-reference"), client), clock), LIMITS, clock)
        heater.connect()
        heater.arm(0.5)
        heater.exchange(0.3)
        heater.enter_safe_state()
        assert rig.firmware.current_a == 0.0
        assert rig.bench.events[-1].endswith("disarmed")
        if len(seen) <= failing:
            break
        failing += 1
    assert failing > 20


class Shifted:
    """The far end of a line. Its device answers an exchange with the registers behind the requested ones."""

    def __init__(self, line, shift):
        self._line = line
        self._shift = shift

    def receive(self, data, time_s):
        if data[1] == 23:
            address = int.from_bytes(data[2:4], "big") + self._shift
            data = rtu.seal(data[0], data[1:2] + address.to_bytes(2, "big") + data[4:-2])
        return self._line.receive(data, time_s)


@pytest.mark.parametrize("shift", [1, 2])
@pytest.mark.parametrize("draw", range(3))
def test_reply_of_adjacent_registers_is_not_taken_for_the_echo(rig, clock, shift, draw):
    """State, faults and limits are small numbers, which a small sequence number could equal."""
    transport = InProcessTransport(Shifted(rig.line, shift), clock)
    board = HeaterBoard(Device(load_profile("sma-reference"), ModbusClient(transport)), clock)
    board.device.check_identity()
    for _ in range(300):
        with pytest.raises(ProtocolError):
            board.exchange(0.0)


def test_sequence_starts_at_random_above_the_registers_next_to_its_echo(rig, clock):
    def board():
        return HeaterBoard(Device(load_profile("sma-reference"), ModbusClient(rig.transport(clock))), clock)

    assert len({board()._sequence for _ in range(8)}) > 1
    wrapping = board()
    wrapping.device.check_identity()
    wrapping._sequence = SEQUENCES[-1] - 1
    sent = []
    for _ in range(3):
        wrapping.exchange(0.0)
        sent.append(rig.firmware.sequence)
    assert sent == [SEQUENCES[-1], SEQUENCES[0], SEQUENCES[0] + 1]
    assert SEQUENCES[0] > 0b1111111  # every fault bit of map version 1


def test_safe_state_ends_with_zero_current_confirmed(heater, run, rig):
    heater.connect()
    heater.arm(0.5)
    run(0.4, 0.5)
    heater.enter_safe_state()
    assert not heater.exchange(0.0).armed
    assert rig.firmware.current_a == 0.0
    assert rig.bench.events[-1].endswith("disarmed")


def test_a_board_found_heating_is_turned_off_by_connecting(heater, rig):
    rig.firmware.write({"arm": 1})
    rig.firmware.write({"sequence": 3, "heater_current": 0.4, "heater_enable": 1})
    assert not heater.connect().armed
    assert rig.firmware.current_a == 0.0


def test_a_profile_without_the_roles_is_refused(rig, clock):
    profile = load_profile("sma-reference")
    roles = profile.roles.model_copy(update={"sequence": None})
    device = Device(profile.model_copy(update={"roles": roles}), ModbusClient(rig.transport(clock)))
    with pytest.raises(ConfigError, match="'sequence'"):
        Heater(HeaterBoard(device, clock), HeaterLimits(0.5, 100.0), clock)
