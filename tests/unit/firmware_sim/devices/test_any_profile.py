"""The plant behind every shipped profile and model, read and written by the real driver."""

import pytest

from firmware_sim.bench import simulated_device
from firmware_sim.config import load_sim
from smadrive.clock import VirtualClock
from smadrive.devices.device import Device
from smadrive.devices.profile.profile import load_profile
from smadrive.errors import ConfigError, DeadlineError, ExceptionReply, IdentityError
from smadrive.files.shipped import configs_dir
from smadrive.modbus import requests
from smadrive.modbus.bus import BusTiming
from smadrive.modbus.client import ModbusClient

SHIPPED = [load_profile(path) for path in sorted((configs_dir() / "devices").glob("*.toml"))]
PROFILES = [profile for profile in SHIPPED if profile.has_registers]
SUPPLIES = [profile for profile in PROFILES if profile.profile.role == "supply"]
MODELS = [profile for family in SUPPLIES for profile in (family, *map(family.as_variant, family.variants))]
THERMOMETERS = [profile for profile in PROFILES if profile.profile.role == "temperature"]


def name_of(profile):
    return profile.profile.id


@pytest.fixture
def connect(config):
    """A function that returns a simulated device of `model`, and its driver, which knows only the `family`."""

    def make(model, family=None):
        clock = VirtualClock()
        simulated = simulated_device(config, seed=1, profile=model)
        clock.follow(simulated.bench.advance_to)
        return simulated, Device(family or load_profile(model.profile.id), ModbusClient(simulated.transport(clock)))

    return make


@pytest.mark.parametrize("profile", PROFILES, ids=name_of)
def test_every_readable_register_can_be_read(connect, profile):
    _, device = connect(profile)
    device.check_identity()
    names = [name for name, register in profile.registers.items() if register.access != "w"]
    assert set(device.read(names)) == set(names)


@pytest.mark.parametrize("model", MODELS, ids=name_of)
def test_supply_of_every_model_heats_the_wire_as_commanded(connect, model):
    simulated, device = connect(model)
    role = model.role
    if "ovp" in model.registers:
        device.write("ovp", 30.0)
    device.write(role("heater_voltage"), 12.0)
    device.write(role("heater_current"), 0.3)
    assert simulated.firmware.current_a == 0.0
    device.write(role("heater_enable"), 1)
    assert simulated.firmware.current_a == pytest.approx(0.3)
    simulated.bench.advance_to(simulated.bench.time_s + model.timing.settle_ms / 1e3 + 2.0)
    device.client.clock.sleep_until(simulated.bench.time_s)
    readings = device.read((role("measured_current"), role("measured_voltage")))
    current, voltage = readings[role("measured_current")], readings[role("measured_voltage")]
    assert current.value == pytest.approx(0.3, abs=0.011)
    assert voltage.value == pytest.approx(0.3 * simulated.bench.plant.resistance_ohm, abs=0.05)
    if model.roles.regulation:
        assert device.read((role("regulation"),))[role("regulation")].words == ("cc",)
    device.enter_safe_state()
    assert simulated.firmware.current_a == 0.0


def test_current_is_lower_at_the_voltage_limit(connect):
    simulated, device = connect(load_profile("juntek-dpm86xx"))
    for name, value in (("v_set", 1.0), ("i_set", 0.5), ("output", 1)):
        device.write(name, value)
    simulated.bench.advance_to(simulated.bench.time_s + 0.1)
    assert simulated.bench.plant.current_a == pytest.approx(1.0 / simulated.bench.plant.resistance_ohm, rel=0.01)
    assert device.read(("regulation",))["regulation"].words == ("cv",)
    device.write("output", 0)
    simulated.bench.advance_to(simulated.bench.time_s + 0.1)
    assert device.read(("regulation",))["regulation"].words == ("off",)


@pytest.mark.parametrize("profile", THERMOMETERS, ids=name_of)
def test_thermometer_shows_the_wire_and_its_own_sentinel(connect, profile):
    simulated, device = connect(profile)
    device.check_identity()
    simulated.bench.plant.temperature_c = 80.0
    simulated.bench.sensors.advance(80.0, 10.0)
    device.client.clock.sleep_until(simulated.bench.time_s + 0.5)
    name = profile.role("temperature")
    assert 60.0 < device.read((name,))[name].value < 81.0  # the wire goes on cooling
    if profile.register(name).invalid:
        simulated.bench.sensors.faults.open_thermocouple()
        device.client.clock.sleep_until(simulated.bench.time_s + 0.5)
        assert "open" in device.read((name,))[name].invalid


def test_displacement_is_read_in_one_request_and_invalid_without_signal(connect, config):
    profile = load_profile("baumer-om20")
    simulated, device = connect(profile)
    simulated.bench.advance_to(0.1)
    before = device.client.counters.requests
    reading = device.read(("distance",))["distance"]
    assert reading.value == pytest.approx(simulated.bench.plant.displacement_mm, abs=0.1)
    assert device.client.counters.requests == before + 1
    blind = simulated_device(config.model_copy(update={"displacement": None}), profile=profile)
    reading = Device(profile, ModbusClient(blind.transport())).read(("distance",))["distance"]
    assert reading.invalid == "quality: no signal"


def test_reading_is_constant_between_two_conversions(connect):
    simulated, device = connect(load_profile("delta-dtb"))
    simulated.bench.advance_to(0.45)
    first = device.read(("pv",))["pv"].raw
    simulated.bench.sensors.temperature_c = 90.0
    assert device.read(("pv",))["pv"].raw == first


def test_lock_is_opened_before_the_first_write_and_when_it_was_closed(connect):
    _, device = connect(load_profile("delta-dtb"))
    with pytest.raises(ExceptionReply) as error:
        device.client.execute(1, requests.write_register(0x1001, 800), device.profile.bus_timing())
    assert error.value.code == 4
    device.write("sv", 80.0)
    device.client.execute(1, requests.write_coil(0x0810, False), device.profile.bus_timing())
    device.write("sv", 60.0)
    assert device.read(("sv", "comm_write_enable"))["sv"].value == 60.0


def test_write_in_wrong_order_is_rejected(connect):
    _, device = connect(load_profile("xy-sk-family"))
    with pytest.raises(ConfigError, match=r"v_set\b.*\bovp\b"):
        device.write("v_set", 5.0)


def test_range_is_read_before_every_write(connect):
    family = load_profile("riden-rd60xx")
    low, high = (variant for variant in family.variants if "current_range" in variant.match)
    simulated, device = connect(family.as_variant(low))
    device.write("i_set", 0.3)
    assert device.profile.register("i_set").scale == 0.0001
    simulated.responder._bank.preset("current_range", 1)  # at the panel
    with pytest.raises(ConfigError, match=r"0 to 12\b"):
        device.write("i_set", 13.0)
    assert device.profile.register("i_set").scale == 0.001
    assert high.registers["i_set"].scale == 0.001


def test_registers_of_an_unknown_range_are_invalid_and_the_output_can_be_switched_off(connect):
    family = load_profile("riden-rd60xx")
    low = next(variant for variant in family.variants if "current_range" in variant.match)
    simulated, device = connect(family.as_variant(low))
    bank = simulated.responder._bank
    device.write("i_set", 0.3)
    device.write("output", 1)
    bank.preset("current_range", 255)
    with pytest.raises(ConfigError, match=r"current_range: 255"):
        device.write("i_set", 0.3)
    readings = device.read(("i_out", "v_out", "i_set", "output"))
    assert [readings[name].invalid for name in ("i_out", "v_out", "i_set")] == ["current_range: 255"] * 3
    assert readings["output"].words == ("on",)
    with pytest.raises(ConfigError):
        device.enter_safe_state()
    assert simulated.firmware.current_a == 0.0
    bank.preset("current_range", 0)
    device.enter_safe_state()
    assert device.profile.register("i_set").scale == 0.0001


def test_model_without_a_range_switch_ignores_the_register_of_the_switch(connect):
    simulated, device = connect(load_profile("riden-rd60xx"))
    simulated.responder._bank.preset("current_range", 255)
    device.write("i_set", 0.3)
    assert device.read(("i_set",))["i_set"].value == 0.3


def test_model_outside_the_family_is_rejected(connect):
    family = load_profile("riden-rd60xx")
    simulated, device = connect(family)
    simulated.responder._bank.preset("model_id", 60050)
    with pytest.raises(IdentityError, match=r"model_id.*60050"):
        device.write("output", 0)


def test_setpoint_uses_the_decimals_and_unit_of_the_device(connect):
    simulated, device = connect(load_profile("autonics-tk"))
    bank = simulated.responder._bank
    bank.preset("decimal_point", 1)
    bank.preset("temp_unit", 1)
    device.write("sv", 100.0)
    assert bank.read("holding", 0, 1) == [2120]
    bank.preset("temp_unit", 2)
    with pytest.raises(ConfigError, match="'%'"):
        device.write("sv", 100.0)
    assert "'%'" in device.read(("pv",))["pv"].invalid


def test_temperature_is_converted_from_the_unit_of_the_panel(connect):
    simulated, device = connect(load_profile("delta-dtb"))
    simulated.bench.advance_to(0.45)
    bank, shown = simulated.responder._bank, {}
    for unit, raw in (("degC", 1), ("degF", 0)):
        bank.preset("temp_unit", raw)
        device.write("sv", 100.0)
        readings = device.read(("pv", "sv", "temp_unit"))
        assert readings["temp_unit"].words == (unit,)
        assert readings["sv"].value == 100.0
        shown[unit] = readings["pv"]
    assert shown["degC"].raw == pytest.approx(220, abs=5)
    assert shown["degF"].raw == pytest.approx(1.8 * shown["degC"].raw + 320, abs=2)
    assert shown["degF"].value == pytest.approx(shown["degC"].value, abs=0.1)


def test_simulated_thermometer_starts_in_degrees_celsius(connect):
    _, device = connect(load_profile("delta-dtb"))
    assert device.read(("temp_unit",))["temp_unit"].words == ("degC",)


def test_nonvolatile_register_is_written_only_when_it_changes(connect):
    _, device = connect(load_profile("autonics-tk"))
    device.write("sv", 50.0)
    counters = device.client.counters
    before = counters.requests - counters.probes
    device.write("sv", 50.0)
    unchanged = counters.requests - counters.probes - before
    device.write("sv", 51.0)
    changed = counters.requests - counters.probes - before - unchanged
    assert changed == unchanged + 2  # the write and its read-back
    with pytest.raises(ConfigError, match=r"\bsv\b"):
        device.exchange({"sv": 50.0}, ("control_mode",))


def test_driver_waits_for_a_starting_device(connect):
    simulated, device = connect(load_profile("xy-sk-family"))
    assert simulated.profile.timing.boot_ms == 2000
    device.check_identity()
    assert 2.0 <= simulated.bench.time_s < 3.5


def test_driver_polls_no_faster_than_the_device_allows(connect):
    simulated, device = connect(load_profile("riden-rd60xx"))
    device.check_identity()
    start_s = simulated.bench.time_s
    for _ in range(10):
        device.read(("v_out",))
    assert simulated.bench.time_s - start_s >= 0.999


def test_device_ignores_requests_within_its_minimum_gap(connect):
    _, device = connect(load_profile("xy-sk-family"))
    device.check_identity()
    hasty = BusTiming(response_timeout_s=0.1, read_retries=0)
    with pytest.raises(DeadlineError):
        device.client.execute(1, requests.read_holding(2, 1), hasty)


def test_requests_of_bits_get_the_replies_of_the_standard(config):
    simulated = simulated_device(load_sim("flexinol-lt-0.15mm"), profile=load_profile("adam-6018"))
    answer = simulated.responder.answer
    for request, reply in [
        ("05 00 10 FF 00", "05 00 10 FF 00"),
        ("05 00 10 12 34", "85 03"),
        ("05 00 20 FF 00", "85 02"),
        ("0F 00 11 00 03 01 05", "0F 00 11 00 03"),
        ("0F 00 11 00 03 02 05 00", "8F 03"),
        ("01 00 10 00 08", "01 01 0B"),
        ("01 00 10 00 00", "81 03"),
        ("01 00 10 07 D1", "81 03"),
        ("01 00 10 00 09", "81 02"),
        ("02 00 10 00 08", "02 01 0B"),
    ]:
        assert answer(bytes.fromhex(request)) == bytes.fromhex(reply), request


@pytest.mark.parametrize(
    ("name", "current_max_a", "scale"),
    [
        ("riden-rd60xx:model_id=60062", 6.0, 0.001),
        ("riden-rd60xx:model_id=60121", 12.0, 0.01),
        ("riden-rd60xx:model_id=60125,current_range=0", 6.0, 0.0001),
        ("xy-sk-family:model_id=0x6500", 25.0, 0.01),
    ],
)
def test_driver_detects_the_model_within_a_family(connect, name, current_max_a, scale):
    model = load_profile(name)
    _, device = connect(model)
    family = Device(load_profile(name.partition(":")[0]), device.client)
    family.check_identity()
    for one in (device, family):
        one.check_identity()
        register = one.profile.register("i_set")
        assert (register.max, register.scale) == (current_max_a, scale)
        pinned = {proof.register_: proof.ranges for proof in model.identify}["model_id"][0][0]
        assert one.read(("model_id",))["model_id"].raw == pinned


def test_another_model_than_the_given_one_is_rejected(connect):
    _, device = connect(load_profile("riden-rd60xx:model_id=60121"))
    with pytest.raises(IdentityError, match=r"60121.*60122"):
        Device(load_profile("riden-rd60xx:model_id=60122"), device.client).check_identity()


@pytest.mark.parametrize(
    ("name", "keys"),
    [
        ("riden-rd60xx:model_id=1", "model_id.*\\b1\\b"),
        ("riden-rd60xx:model_id=60125", "current_range"),
        ("riden-rd60xx:modelid=60121", "'modelid'.*'model_id'"),
        ("riden-rd60xx:model_id=RD6012", "REGISTER=RAW"),
    ],
)
def test_unknown_model_is_rejected(name, keys):
    with pytest.raises(ConfigError, match=keys):
        load_profile(name)
