"""The emulated board is a simulated device like any other: bench, bus faults, sensor faults, power."""

import struct

import pytest
from emulated_board import ARM, ESTOP, FAULTS, KEYS, SEQUENCE, STATE, UNIT_ID, needs_emulator

from firmware_sim.bench import SimulatedBench, simulated_device
from firmware_sim.board.emulator.build import firmware_file, range_for, ranges
from firmware_sim.config import load_sim
from firmware_sim.devices.board.readings import BoardFault
from smadrive.devices.profile.profile import load_profile
from smadrive.errors import ConfigError
from smadrive.modbus.framing import mbap, rtu

IDENTITY = bytes.fromhex("03 00 00 00 02")
REPLY = bytes.fromhex("03 04 53 4D 00 02")


def emulated_config(**board):
    config = load_sim("flexinol-lt-0.15mm")
    update = {"implementation": "atmega328p", "serial_number": 4711, **board}
    return config.model_copy(update={"board": config.board.model_copy(update=update)})


@pytest.fixture
def device():
    return simulated_device(emulated_config(), seed=3)


def ask(device, pdu):
    """Return time and PDU of the reply, or None."""
    deliveries = device.line.receive(rtu.seal(UNIT_ID, pdu), device.bench.time_s)
    return [(due_s, frame[1:-2]) for due_s, frame in deliveries]


def read(device, first, count=1):
    ((_, reply),) = ask(device, struct.pack(">BHH", 3, first, count))
    return list(struct.unpack(f">{count}H", reply[2:]))


def heat(device, current_a, duration_s):
    bench = device.bench
    ask(device, struct.pack(">BHH", 6, ARM, KEYS[ARM]))
    end_s, sequence = bench.time_s + duration_s, 500
    while bench.time_s < end_s:
        sequence += 1
        ask(device, struct.pack(">BHHHHB3H", 23, 16, 11, SEQUENCE, 3, 6, sequence, round(current_a * 1e4), 1))
        bench.advance_to(bench.time_s + 0.05)


@needs_emulator
def test_reply_arrives_at_the_speed_of_the_line(device):
    ((due_s, reply),) = ask(device, IDENTITY)
    assert reply == REPLY
    assert 17 * 10 / 115200 < due_s - device.bench.time_s < 0.01


@needs_emulator
def test_wire_is_heated_and_measured(device):
    heat(device, 0.3, 3.0)
    assert device.bench.plant.temperature_c > 80.0
    temperature, _, current, voltage = read(device, 20, 4)
    assert temperature / 100 == pytest.approx(device.bench.sensors.temperature_c, abs=1.5)
    assert current / 1e4 == pytest.approx(0.3, abs=2e-3)
    assert voltage / 1e3 == pytest.approx(device.bench.plant.voltage_v, abs=0.02)
    assert read(device, 3, 2) == [0, 4711]
    device.bench.advance_to(device.bench.time_s + 0.6)
    assert device.bench.plant.current_a == 0.0


@needs_emulator
@pytest.mark.parametrize(
    ("begin", "fault"),
    [
        ("open_thermocouple", BoardFault.THERMOCOUPLE_OPEN),
        ("short_thermocouple", BoardFault.THERMOCOUPLE_SHORT),
        ("press_estop", BoardFault.ESTOP),
        ("silence_sensor_bus", BoardFault.SENSOR_BUS),
        ("stick_actuator", BoardFault.ACTUATOR),
        ("lose_voltage", BoardFault.SENSOR_BUS),
    ],
)
def test_faults_of_the_sensors_act_on_the_chips(device, begin, fault):
    heat(device, 0.2, 0.3)
    getattr(device.bench.sensors.faults, begin)()
    device.bench.advance_to(device.bench.time_s + 0.2)
    assert device.firmware.current_a == 0.0
    assert read(device, STATE, 2) == [2, fault]
    assert read(device, ESTOP) == [begin == "press_estop"]


@needs_emulator
def test_bus_faults_alter_the_replies(device):
    device.faults.drop()
    assert ask(device, IDENTITY) == []
    device.faults.refuse(6)
    assert [reply for _, reply in ask(device, IDENTITY)] == [bytes((0x83, 6))]
    assert [reply for _, reply in ask(device, IDENTITY)] == [REPLY]


@needs_emulator
def test_power_cycle_ends_heating_and_keeps_the_storage(device):
    heat(device, 0.3, 0.3)
    device.power_cycle()
    assert device.firmware.current_a == 0.0
    device.bench.advance_to(device.bench.time_s + 0.4)
    assert read(device, STATE, 2) == [0, 0]
    assert read(device, 3, 2) == [0, 4711]


@needs_emulator
def test_board_without_power_does_not_answer(device):
    device.brown_out(1.0)
    device.bench.advance_to(0.5)
    assert ask(device, IDENTITY) == []
    device.bench.advance_to(1.4)
    assert [reply for _, reply in ask(device, IDENTITY)] == [REPLY]


@needs_emulator
def test_gateway_passes_requests(device):
    ((_, frame),) = device.line.new_port(numbered=True).receive(mbap.seal(7, UNIT_ID, IDENTITY), 0.0)
    assert frame[mbap.HEADER_SIZE :] == REPLY


@needs_emulator
def test_same_seed_gives_the_same_board():
    traces = []
    for _ in range(2):
        device = simulated_device(emulated_config(), seed=5)
        heat(device, 0.25, 0.5)
        traces.append((read(device, 16, 14), device.bench.plant.temperature_c))
    assert traces[0] == traces[1]
    assert traces[0][0][FAULTS - 16] == 0


def test_first_version_of_the_map_has_no_program():
    bench = SimulatedBench(emulated_config())
    with pytest.raises(ConfigError):
        bench.attach(load_profile("sma-reference:map_version=1"))


def test_current_above_every_range_is_an_error():
    with pytest.raises(ConfigError) as error:
        range_for(6.0)
    assert (error.value.where, error.value.value) == ("supply_limit_a", 6.0)
    assert range_for(0.4) == ranges()[1]


def test_missing_programs_are_named(tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    with pytest.raises(ConfigError) as error:
        firmware_file(load_sim("flexinol-lt-0.15mm").board)
    assert "avr-gcc" in error.value.value
    assert "apt-get install" in error.value.cure
