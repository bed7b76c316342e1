"""The plant through every shipped profile and model: what the real driver reads and writes by that device's map."""

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
    """A simulated device of `model`, and the driver that knows its `family`."""

    def make(model, family=None):
        clock = VirtualClock()
        rig = simulated_device(config, seed=1, profile=model)
        clock.follow(rig.bench.advance_to)
        return rig, Device(family or load_profile(model.profile.id), ModbusClient(rig.transport(clock)))

    return make


@pytest.mark.parametrize("profile", PROFILES, ids=name_of)
def test_every_readable_register_can_be_read(connect, profile):
    _, device = connect(profile)
    device.check_identity()
    names = [name for name, register in profile.registers.items() if register.access != "w"]
    assert set(device.read(names)) == set(names)


@pytest.mark.parametrize("model", MODELS, ids=name_of)
def test_a_supply_of_any_model_heats_the_wire_as_told(connect, model):
    rig, device = connect(model)
    role = model.role
    if "ovp" in model.registers:
        device.write("ovp", 30.0)
    device.write(role("heater_voltage"), 12.0)
    device.write(role("heater_current"), 0.3)
    assert rig.firmware.current_a == 0.0
    device.write(role("heater_enable"), 1)
    assert rig.firmware.current_a == pytest.approx(0.3)
    rig.bench.advance_to(rig.bench.time_s + model.timing.settle_ms / 1e3 + 2.0)
    device.client.clock.sleep_until(rig.bench.time_s)
    shown = device.read((role("measured_current"), role("measured_voltage")))
    current, voltage = shown[role("measured_current")], shown[role("measured_voltage")]
    assert current.value == pytest.approx(0.3, abs=0.011)
    assert voltage.value == pytest.approx(0.3 * rig.bench.plant.resistance_ohm, abs=0.05)
    if model.roles.regulation:
        assert device.read((role("regulation"),))[role("regulation")].words == ("cc",)
    device.enter_safe_state()
    assert rig.firmware.current_a == 0.0


def test_a_voltage_limit_that_is_reached_holds_the_current_back(connect):
    rig, device = connect(load_profile("juntek-dpm86xx"))
    for name, value in (("v_set", 1.0), ("i_set", 0.5), ("output", 1)):
        device.write(name, value)
    rig.bench.advance_to(rig.bench.time_s + 0.1)
    assert rig.bench.plant.current_a == pytest.approx(1.0 / rig.bench.plant.resistance_ohm, rel=0.01)
    assert device.read(("regulation",))["regulation"].words == ("cv",)
    device.write("output", 0)
    rig.bench.advance_to(rig.bench.time_s + 0.1)
    assert device.read(("regulation",))["regulation"].words == ("off",)


@pytest.mark.parametrize("profile", THERMOMETERS, ids=name_of)
def test_a_thermometer_shows_the_wire_and_its_own_sentinel(connect, profile):
    rig, device = connect(profile)
    device.check_identity()
    rig.bench.plant.temperature_c = 80.0
    rig.bench.sensors.advance(80.0, 10.0)
    device.client.clock.sleep_until(rig.bench.time_s + 0.5)
    name = profile.role("temperature")
    assert 60.0 < device.read((name,))[name].value < 81.0  # the wire cools on
    if profile.register(name).invalid:
        rig.bench.sensors.faults.open_thermocouple()
        device.client.clock.sleep_until(rig.bench.time_s + 0.5)
        assert "open" in device.read((name,))[name].invalid


def test_the_displacement_is_read_in_one_piece_and_invalid_without_signal(connect, config):
    profile = load_profile("baumer-om20")
    rig, device = connect(profile)
    rig.bench.advance_to(0.1)
    before = device.client.counters.requests
    reading = device.read(("distance",))["distance"]
    assert reading.value == pytest.approx(rig.bench.plant.displacement_mm, abs=0.1)
    assert device.client.counters.requests == before + 1
    blind = simulated_device(config.model_copy(update={"displacement": None}), profile=profile)
    reading = Device(profile, ModbusClient(blind.transport())).read(("distance",))["distance"]
    assert reading.invalid == "quality: no signal"


def test_a_thermometer_converts_no_faster_than_it_can(connect):
    rig, device = connect(load_profile("delta-dtb"))
    rig.bench.advance_to(0.45)
    first = device.read(("pv",))["pv"].raw
    rig.bench.sensors.temperature_c = 90.0
    assert device.read(("pv",))["pv"].raw == first


def test_the_lock_is_opened_before_the_first_write_and_after_a_power_cycle_of_it(connect):
    _, device = connect(load_profile("delta-dtb"))
    with pytest.raises(ExceptionReply) as error:
        device.client.execute(1, requests.write_register(0x1001, 800), device.profile.bus_timing())
    assert error.value.code == 4
    device.write("sv", 80.0)
    device.client.execute(1, requests.write_coil(0x0810, False), device.profile.bus_timing())
    device.write("sv", 60.0)
    assert device.read(("sv", "comm_write_enable"))["sv"].value == 60.0


def test_a_write_out_of_order_is_refused_with_its_cure(connect):
    _, device = connect(load_profile("xy-sk-family"))
    with pytest.raises(ConfigError) as error:
        device.write("v_set", 5.0)
    assert error.value.where == "register 'v_set'"
    assert error.value.cure == "write 'ovp' first"


def test_the_scales_of_a_range_switch_are_looked_up_before_every_write(connect):
    family = load_profile("riden-rd60xx")
    low, high = (variant for variant in family.variants if "current_range" in variant.match)
    rig, device = connect(family.as_variant(low))
    device.write("i_set", 0.3)
    assert device.profile.register("i_set").scale == 0.0001
    rig.responder._bank.preset("current_range", 1)  # at the panel
    with pytest.raises(ConfigError) as error:
        device.write("i_set", 13.0)
    assert error.value.limit == "0 to 12"
    assert device.profile.register("i_set").scale == 0.001
    assert high.registers["i_set"].scale == 0.001


def test_a_model_that_is_not_of_the_family_is_refused(connect):
    family = load_profile("riden-rd60xx")
    rig, device = connect(family)
    rig.responder._bank.preset("model_id", 60050)
    with pytest.raises(IdentityError) as error:
        device.write("output", 0)
    assert error.value.value == "model_id = 60050"


def test_a_setpoint_follows_the_decimals_and_the_unit_that_the_device_holds(connect):
    rig, device = connect(load_profile("autonics-tk"))
    bank = rig.responder._bank
    bank.preset("decimal_point", 1)
    bank.preset("temp_unit", 1)
    device.write("sv", 100.0)
    assert bank.read("holding", 0, 1) == [2120]
    bank.preset("temp_unit", 2)
    with pytest.raises(ConfigError) as error:
        device.write("sv", 100.0)
    assert error.value.where == "register 'sv'"
    assert "'%'" in error.value.value
    assert "in '%'" in device.read(("pv",))["pv"].invalid


def test_a_memory_that_wears_is_written_only_when_it_changes(connect):
    _, device = connect(load_profile("autonics-tk"))
    device.write("sv", 50.0)
    counters = device.client.counters
    before = counters.requests - counters.probes
    device.write("sv", 50.0)
    unchanged = counters.requests - counters.probes - before
    device.write("sv", 51.0)
    changed = counters.requests - counters.probes - before - unchanged
    assert changed == unchanged + 2  # the write and its read-back
    with pytest.raises(ConfigError) as error:
        device.exchange({"sv": 50.0}, ("control_mode",))
    assert error.value.where == "register 'sv'"


def test_a_device_that_starts_up_is_waited_for(connect):
    rig, device = connect(load_profile("xy-sk-family"))
    assert rig.profile.timing.boot_ms == 2000
    device.check_identity()
    assert 2.0 <= rig.bench.time_s < 3.5


def test_the_device_is_polled_no_faster_than_it_stands(connect):
    rig, device = connect(load_profile("riden-rd60xx"))
    device.check_identity()
    start_s = rig.bench.time_s
    for _ in range(10):
        device.read(("v_out",))
    assert rig.bench.time_s - start_s >= 0.999


def test_without_its_pause_the_device_hears_nothing(connect):
    _, device = connect(load_profile("xy-sk-family"))
    device.check_identity()
    hasty = BusTiming(response_timeout_s=0.1, read_retries=0)
    with pytest.raises(DeadlineError):
        device.client.execute(1, requests.read_holding(2, 1), hasty)


def test_bits_are_answered_by_the_book(config):
    rig = simulated_device(load_sim("flexinol-lt-0.15mm"), profile=load_profile("adam-6018"))
    answer = rig.responder.answer
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
def test_the_simulator_is_any_model_of_a_family_and_the_driver_finds_out_which(connect, name, current_max_a, scale):
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


def test_another_model_than_the_one_named_is_refused(connect):
    _, device = connect(load_profile("riden-rd60xx:model_id=60121"))
    with pytest.raises(IdentityError) as error:
        Device(load_profile("riden-rd60xx:model_id=60122"), device.client).check_identity()
    assert (error.value.value, error.value.limit) == ("model_id = 60121", "60122")


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("riden-rd60xx:model_id=1", "model_id = 1"),
        ("riden-rd60xx:model_id=60125", "Add ,current_range=RAW"),
        ("riden-rd60xx:modelid=60121", "no register 'modelid'; did you mean 'model_id'"),
        ("riden-rd60xx:model_id=RD6012", "Write REGISTER=RAW"),
    ],
)
def test_a_model_that_cannot_be_is_refused(name, says):
    with pytest.raises(ConfigError, match=says):
        load_profile(name)
