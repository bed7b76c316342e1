"""State machine, watchdog and latched faults of the board, in virtual time."""

import pytest

from firmware_sim.bench import simulated_device
from firmware_sim.devices.board.checks import BoardLimit
from firmware_sim.devices.board.firmware import BoardState
from firmware_sim.devices.board.readings import BoardFault
from smadrive.devices.device import Device
from smadrive.modbus.client import ModbusClient


def test_board_starts_idle_and_cold(simulated):
    simulated.bench.advance_to(1.0)
    assert simulated.firmware.state is BoardState.IDLE
    assert simulated.bench.plant.temperature_c == pytest.approx(22.0)


def test_only_the_arm_key_arms(ask, simulated):
    assert ask("10 00 20 00 03 06 01 01 0B B8 00 01") == "10 00 20 00 03"
    assert ask("03 00 20 00 03") == "03 06 01 01 00 00 00 00"
    assert simulated.firmware.state is BoardState.IDLE
    assert ask("06 00 28 41 52") == "06 00 28 41 52"
    assert simulated.firmware.state is BoardState.ARMED
    assert ask("06 00 28 41 52") == "86 04"
    assert ask("10 00 20 00 03 06 01 02 0B B8 00 01") == "10 00 20 00 03"
    assert simulated.firmware.current_a == pytest.approx(0.3)


def test_enable_0_disarms_and_sets_the_current_to_zero(heat, simulated, ask):
    heat(0.3, 0.2)
    assert ask("06 00 22 00 00") == "06 00 22 00 00"
    assert simulated.firmware.state is BoardState.IDLE
    assert simulated.firmware.current_a == 0.0
    assert ask("03 00 21 00 02") == "03 04 00 00 00 00"


@pytest.mark.parametrize("watchdog_s", [0.05, 0.5, 10.0])
def test_watchdog_trips_on_time(heat, simulated, watchdog_s):
    heat(0.2, 0.02, watchdog_s)
    fed_s = simulated.bench.time_s - 0.02
    simulated.bench.advance_to(fed_s + watchdog_s - 0.01)
    assert simulated.firmware.current_a > 0
    simulated.bench.advance_to(fed_s + watchdog_s)
    assert simulated.firmware.current_a == 0.0
    assert simulated.firmware.state is BoardState.FAULT
    assert simulated.firmware.faults == BoardFault.WATCHDOG
    assert (
        simulated.bench.events[-1]
        == f"t={fed_s + watchdog_s:.3f} s watchdog: no new sequence for {watchdog_s:.3f} s, heater off"
    )


def test_reads_and_repeated_sequence_do_not_feed_the_watchdog(heat, simulated, ask):
    heat(0.2, 0.05)
    for _ in range(12):
        ask("03 00 10 00 0D")
        ask(f"10 00 20 00 03 06 {simulated.firmware.sequence:04X} 07 D0 00 01")
        simulated.bench.advance_to(simulated.bench.time_s + 0.05)
    assert simulated.firmware.faults == BoardFault.WATCHDOG


def test_watchdog_does_not_run_while_idle(simulated):
    simulated.bench.advance_to(30.0)
    assert simulated.firmware.state is BoardState.IDLE


def test_fault_latches_until_the_clear_key_and_prevents_arming(heat, simulated, ask):
    heat(0.2, 0.05)
    simulated.bench.advance_to(2.0)
    assert ask("06 00 28 41 52") == "86 04"
    assert ask("17 00 11 00 02 00 20 00 03 06 12 34 0B B8 00 01") == "17 04 00 02 00 01"
    assert simulated.firmware.current_a == 0.0
    assert ask("06 00 29 43 4C") == "06 00 29 43 4C"
    assert simulated.firmware.state is BoardState.IDLE
    assert ask("06 00 28 41 52") == "06 00 28 41 52"


@pytest.mark.parametrize(
    ("fail", "fault"),
    [
        (lambda simulated: simulated.bench.sensors.faults.open_thermocouple(), BoardFault.THERMOCOUPLE_OPEN),
        (lambda simulated: simulated.bench.sensors.faults.short_thermocouple(), BoardFault.THERMOCOUPLE_SHORT),
        (lambda simulated: setattr(simulated.bench.sensors, "cold_junction_c", 90.0), BoardFault.COLD_JUNCTION_RANGE),
        (lambda simulated: simulated.bench.plant.faults.break_wire(), BoardFault.HEATER_OPEN),
        (lambda simulated: simulated.bench.plant.faults.short_switch(0.9), BoardFault.OVER_CURRENT),
    ],
)
def test_every_failure_switches_the_heater_off_and_is_logged(heat, simulated, fail, fault):
    heat(0.3, 0.5)
    fail(simulated)
    heat(0.3, 0.1)
    assert simulated.firmware.state is BoardState.FAULT
    assert simulated.firmware.faults == fault
    assert simulated.firmware.current_a == 0.0
    assert fault.name.lower() in simulated.bench.events[-1]


def test_fault_with_persisting_cause_cannot_be_cleared(simulated, ask):
    simulated.bench.sensors.faults.open_thermocouple()
    simulated.bench.advance_to(0.02)
    ask("06 00 29 43 4C")
    assert simulated.firmware.faults == BoardFault.THERMOCOUPLE_OPEN
    assert ask("03 00 14 00 01") == "03 02 80 00"
    simulated.bench.sensors.faults.mend_thermocouple()
    simulated.bench.advance_to(0.04)
    ask("06 00 29 43 4C")
    assert simulated.firmware.state is BoardState.IDLE


def test_derate_band_limits_current_before_over_temperature_trips(heat, simulated):
    simulated.firmware.write({"temperature_max": 60.0})
    heat(0.6, 1.0)
    assert simulated.firmware.limits & BoardLimit.TEMPERATURE or simulated.firmware.faults
    heat(0.6, 10.0)
    assert simulated.bench.plant.temperature_c < 63.0
    simulated.firmware.write({"temperature_max": simulated.bench.sensors.temperature_c - 1})
    simulated.bench.advance_to(simulated.bench.time_s + 0.02)
    assert simulated.firmware.faults & BoardFault.OVER_TEMPERATURE
    assert "over_temperature" in simulated.bench.events[-1]


def test_limits_register_shows_the_active_limit(heat, simulated):
    simulated.firmware.write({"current_max": 0.25})
    heat(0.3, 0.05)
    assert simulated.firmware.current_a == pytest.approx(0.25)
    assert simulated.firmware.limits == BoardLimit.CURRENT_MAX


def test_restart_while_heating_switches_off_and_the_next_command_does_not_heat(heat, simulated, ask):
    heat(0.3, 0.5)
    simulated.power_cycle()
    assert ask("17 00 11 00 01 00 20 00 03 06 33 33 0B B8 00 01") == "17 02 00 00"
    simulated.bench.advance_to(simulated.bench.time_s + 0.05)
    assert simulated.firmware.current_a == 0.0


def test_same_seed_gives_the_same_readings(config, simulated):
    twin = simulated_device(config, seed=1)
    other = simulated_device(config, seed=2)
    for device in (simulated, twin, other):
        device.bench.advance_to(1.0)
    assert simulated.firmware.quantities() == twin.firmware.quantities()
    assert simulated.bench.sensors.temperature_c != other.bench.sensors.temperature_c


def test_serial_number_is_random_unless_the_config_gives_one(config):
    def serial_number(number):
        board = config.board.model_copy(update={"serial_number": number})
        simulated = simulated_device(config.model_copy(update={"board": board}), seed=1)
        device = Device(simulated.profile, ModbusClient(simulated.transport()))
        return device.read(("serial_number",))["serial_number"].raw

    assert serial_number(None) != serial_number(None)
    assert serial_number(7) == serial_number(7) == 7
