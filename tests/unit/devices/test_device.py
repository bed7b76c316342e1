"""Registers by name and in units: few requests, no write before the identity, a read-back for every write."""

import math

import pytest

from firmware_sim.bench import simulated_device
from firmware_sim.config import load_sim
from smadrive.devices.device import Device
from smadrive.devices.profile.profile import load_profile
from smadrive.errors import ConfigError, DeadlineError, ExceptionReply, IdentityError, ReadBackError
from smadrive.modbus.client import ModbusClient


def test_reading_merges_neighbours(device):
    device.check_identity()
    before = device.client.counters.requests
    readings = device.read(("temperature", "cold_junction", "sequence_echo", "state", "faults", "limits", "watchdog_s"))
    assert readings["watchdog_s"].value == 0.5
    assert readings["state"].words == ("idle",)
    assert readings["cold_junction"].value == pytest.approx(25.0)
    assert device.client.counters.requests == before + 2


def test_reading_respects_what_the_device_can(rig, clock):
    profile = load_profile("sma-reference")
    short = profile.model_copy(update={"timing": profile.timing.model_copy(update={"max_read_registers": 4})})
    device = Device(short, ModbusClient(rig.transport(clock)))
    device.check_identity()
    before = device.client.counters.requests
    assert (
        device.read(("device_id", "map_version", "firmware_version", "serial_number"))["serial_number"].value > 1 << 31
    )
    assert device.client.counters.requests == before + 2


def test_an_unknown_register_names_the_nearest(device):
    with pytest.raises(ConfigError) as error:
        device.read(("temprature",))
    assert error.value.where == "profile 'sma-reference'"
    assert "'temperature'" in error.value.cure


def test_sentinel_is_not_a_number(device, rig):
    rig.bench.sensors.faults.open_thermocouple()
    reading = device.read(("temperature",))["temperature"]
    assert math.isnan(reading.value)
    assert reading.invalid == "no reading"


def test_nothing_is_written_to_another_device(rig, clock):
    profile = load_profile("sma-reference")
    other = profile.identify[0].model_copy(update={"ranges": [(1, 9)]})
    device = Device(profile.model_copy(update={"identify": (other,)}), ModbusClient(rig.transport(clock)))
    sequence = rig.firmware.sequence
    for write in (
        lambda: device.write("sequence", 0x107),
        lambda: device.exchange({"sequence": 0x107}, ("state",)),
        device.enter_safe_state,
        device.check_identity,
    ):
        with pytest.raises(IdentityError) as error:
            write()
        assert (error.value.where, error.value.value) == ("unit 1", "device_id = 21325")
        assert error.value.limit == "1 to 9"
    assert rig.firmware.sequence == sequence


def test_a_write_is_read_back(device, rig):
    device.write("watchdog_s", 0.25)
    assert rig.firmware.watchdog_s == 0.25


def test_lost_write_raises_a_read_back_error(device):
    with pytest.raises(ReadBackError) as error:
        device.write("heater_current", 0.3)  # the board is idle, so its current stays zero
    assert error.value.where == "unit 1, register 'heater_current'"
    assert error.value.value == "0 A, wrote 0.3 A"


@pytest.mark.parametrize(("name", "value"), [("watchdog_s", 0.049), ("heater_current", math.nan), ("heater_enable", 2)])
def test_a_write_outside_the_limits_is_not_sent(device, name, value):
    device.check_identity()
    before = device.client.counters.requests
    with pytest.raises(ConfigError) as error:
        device.write(name, value)
    assert error.value.where == f"register '{name}'"
    assert device.client.counters.requests == before


@pytest.mark.parametrize("unit_id", [0, 248, -1])
def test_unit_id_of_no_single_device_is_refused(device, unit_id):
    with pytest.raises(ConfigError) as error:
        Device(device.profile, device.client, unit_id)
    assert (error.value.where, error.value.value, error.value.limit) == ("unit_id", unit_id, "1 to 247")


def test_a_read_only_register_is_not_written(device):
    with pytest.raises(ConfigError) as error:
        device.write("temperature", 20.0)
    assert error.value.where == "register 'temperature' of 'sma-reference'"


def test_exception_reply_to_a_write_names_register_and_value(device):
    with pytest.raises(ExceptionReply) as error:
        device.write("temperature_max", 200.0)
    assert error.value.where.endswith("register 'temperature_max' = 200 degC")
    assert error.value.code == 3


def test_an_exchange_is_one_transaction_in_any_order_of_names(device, rig):
    device.check_identity()
    before = device.client.counters.requests
    readings = device.exchange(
        {"heater_enable": 0, "sequence": 1077, "heater_current": 0.0}, ("state", "sequence_echo", "faults")
    )
    assert readings["sequence_echo"].value == 1077
    assert rig.firmware.sequence == 1077
    assert device.client.counters.requests == before + 1


def test_an_exchange_of_scattered_registers_is_refused(device):
    with pytest.raises(ConfigError) as written:
        device.exchange({"sequence": 0x101, "watchdog_s": 1.0}, ("state",))
    assert written.value.value == "sequence, watchdog_s"
    with pytest.raises(ConfigError) as read:
        device.exchange({"sequence": 0x101}, ("state", "watchdog_s"))
    assert read.value.value == "state, watchdog_s"


def test_reads_survive_a_bad_bus_and_writes_are_not_repeated(device, rig):
    device.check_identity()
    rig.faults.drop()
    rig.faults.corrupt()
    assert device.read(("watchdog_s",))["watchdog_s"].value == 0.5
    rig.faults.drop()
    with pytest.raises(DeadlineError):
        device.exchange({"sequence": 0x105}, ("state",))
    assert rig.firmware.sequence == 0x105  # the exchange was sent and carried out only once
    assert device.client.counters.retries > 0


@pytest.mark.parametrize("fault", ["drop", "corrupt", "truncate"])
def test_the_safe_state_is_reached_on_a_bad_bus(device, rig, fault):
    device.check_identity()
    rig.firmware.write({"arm": 1})
    rig.firmware.write({"sequence": 9, "heater_current": 0.4, "heater_enable": 1})
    getattr(rig.faults, fault)(3)
    device.enter_safe_state()
    assert rig.firmware.current_a == 0.0
    assert rig.firmware.state == 0


def test_a_safe_state_that_cannot_be_confirmed_raises(device, rig):
    device.check_identity()
    rig.faults.drop(1000)
    with pytest.raises(DeadlineError):
        device.enter_safe_state()


def test_the_safe_state_waits_for_a_device_that_is_back_after_a_second(device, rig):
    device.check_identity()
    rig.firmware.write({"arm": 1})
    rig.firmware.write({"sequence": 9, "heater_current": 0.4, "heater_enable": 1})
    rig.faults.drop(for_s=1.5)
    device.enter_safe_state()
    assert rig.firmware.current_a == 0.0


@pytest.mark.parametrize("name", ["autonics-tk", "baumer-om20"])
def test_a_device_whose_type_nothing_proves_must_answer_at_least(clock, name):
    profile = load_profile(name)
    assert not profile.proves_type
    simulated = simulated_device(load_sim("flexinol-lt-0.15mm"), seed=1, profile=profile)
    clock.follow(simulated.bench.advance_to)
    device = Device(profile, ModbusClient(simulated.transport(clock)))
    device.check_identity()
    assert not device.identity
    simulated.faults.drop(1000)
    with pytest.raises(DeadlineError):
        device.check_identity()
