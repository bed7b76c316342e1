"""The state machine, the watchdog and the latched faults, in virtual time."""

import pytest

from firmware_sim.devices.board import Fault, Limit, State


def test_it_wakes_idle_and_cold(rig):
    rig.bench.advance_to(1.0)
    assert rig.firmware.state is State.IDLE
    assert rig.bench.plant.temperature_c == pytest.approx(22.0)


def test_only_the_key_arms(ask, rig):
    assert ask("10 00 20 00 03 06 00 01 0B B8 00 01") == "10 00 20 00 03"
    assert ask("03 00 20 00 03") == "03 06 00 01 00 00 00 00"
    assert rig.firmware.state is State.IDLE
    assert ask("06 00 28 41 52") == "06 00 28 41 52"
    assert rig.firmware.state is State.ARMED
    assert ask("06 00 28 41 52") == "86 04"
    assert ask("10 00 20 00 03 06 00 02 0B B8 00 01") == "10 00 20 00 03"
    assert rig.firmware.current_a == pytest.approx(0.3)


def test_enable_zero_disarms_and_zeroes_the_current(heat, rig, ask):
    heat(0.3, 0.2)
    assert ask("06 00 22 00 00") == "06 00 22 00 00"
    assert rig.firmware.state is State.IDLE
    assert rig.firmware.current_a == 0.0
    assert ask("03 00 21 00 02") == "03 04 00 00 00 00"


@pytest.mark.parametrize("watchdog_s", [0.05, 0.5, 10.0])
def test_the_watchdog_bites_on_time(heat, rig, watchdog_s):
    heat(0.2, 0.02, watchdog_s)
    fed_s = rig.bench.time_s - 0.02
    rig.bench.advance_to(fed_s + watchdog_s - 0.01)
    assert rig.firmware.current_a > 0
    rig.bench.advance_to(fed_s + watchdog_s)
    assert rig.firmware.current_a == 0.0
    assert rig.firmware.state is State.FAULT
    assert rig.firmware.faults == Fault.WATCHDOG
    assert (
        rig.bench.events[-1]
        == f"t={fed_s + watchdog_s:.3f} s watchdog: no new sequence for {watchdog_s:.3f} s, heater off"
    )


def test_traffic_and_a_repeated_sequence_do_not_feed_the_watchdog(heat, rig, ask):
    heat(0.2, 0.05)
    for _ in range(12):
        ask("03 00 10 00 0D")
        ask(f"10 00 20 00 03 06 {rig.firmware.sequence:04X} 07 D0 00 01")
        rig.bench.advance_to(rig.bench.time_s + 0.05)
    assert rig.firmware.faults == Fault.WATCHDOG


def test_idle_has_no_watchdog(rig):
    rig.bench.advance_to(30.0)
    assert rig.firmware.state is State.IDLE


def test_a_fault_latches_until_the_key_and_refuses_to_arm(heat, rig, ask):
    heat(0.2, 0.05)
    rig.bench.advance_to(2.0)
    assert ask("06 00 28 41 52") == "86 04"
    assert ask("17 00 11 00 02 00 20 00 03 06 12 34 0B B8 00 01") == "17 04 00 02 00 01"
    assert rig.firmware.current_a == 0.0
    assert ask("06 00 29 43 4C") == "06 00 29 43 4C"
    assert rig.firmware.state is State.IDLE
    assert ask("06 00 28 41 52") == "06 00 28 41 52"


@pytest.mark.parametrize(
    ("fail", "fault"),
    [
        (lambda rig: rig.bench.sensors.faults.open_thermocouple(), Fault.THERMOCOUPLE_OPEN),
        (lambda rig: rig.bench.sensors.faults.short_thermocouple(), Fault.THERMOCOUPLE_SHORT),
        (lambda rig: setattr(rig.bench.sensors, "cold_junction_c", 90.0), Fault.COLD_JUNCTION_RANGE),
        (lambda rig: rig.bench.plant.faults.break_wire(), Fault.HEATER_OPEN),
        (lambda rig: rig.bench.plant.faults.short_switch(0.9), Fault.OVER_CURRENT),
    ],
)
def test_every_failure_turns_the_heater_off_and_is_named(heat, rig, fail, fault):
    heat(0.3, 0.5)
    fail(rig)
    heat(0.3, 0.1)
    assert rig.firmware.state is State.FAULT
    assert rig.firmware.faults == fault
    assert rig.firmware.current_a == 0.0
    assert fault.name.lower() in rig.bench.events[-1]


def test_a_persisting_cause_cannot_be_cleared(rig, ask):
    rig.bench.sensors.faults.open_thermocouple()
    rig.bench.advance_to(0.02)
    ask("06 00 29 43 4C")
    assert rig.firmware.faults == Fault.THERMOCOUPLE_OPEN
    assert ask("03 00 14 00 01") == "03 02 80 00"
    rig.bench.sensors.faults.mend_thermocouple()
    ask("06 00 29 43 4C")
    assert rig.firmware.state is State.IDLE


def test_over_temperature_trips_and_the_derate_band_holds_back_before(heat, rig):
    rig.firmware.write({"temperature_max": 60.0})
    heat(0.6, 1.0)
    assert rig.firmware.limits & Limit.TEMPERATURE or rig.firmware.faults
    heat(0.6, 10.0)
    assert rig.bench.plant.temperature_c < 63.0
    rig.firmware.write({"temperature_max": rig.bench.sensors.temperature_c - 1})
    rig.bench.advance_to(rig.bench.time_s + 0.02)
    assert rig.firmware.faults & Fault.OVER_TEMPERATURE
    assert "over_temperature" in rig.bench.events[-1]


def test_limits_say_what_holds_the_current_back(heat, rig):
    rig.firmware.write({"current_max": 0.25})
    heat(0.3, 0.05)
    assert rig.firmware.current_a == pytest.approx(0.25)
    assert rig.firmware.limits == Limit.CURRENT_MAX


def test_a_reset_while_heating_is_a_heater_off_that_repeating_the_command_does_not_undo(heat, rig, ask):
    heat(0.3, 0.5)
    rig.power_cycle()
    assert ask("17 00 11 00 01 00 20 00 03 06 33 33 0B B8 00 01") == "17 02 00 00"
    rig.bench.advance_to(rig.bench.time_s + 0.05)
    assert rig.firmware.current_a == 0.0


def test_the_same_seed_gives_the_same_rig(config, heat, rig):
    from firmware_sim.bench import simulated_device

    twin = simulated_device(config, seed=1)
    other = simulated_device(config, seed=2)
    for device in (rig, twin, other):
        device.bench.advance_to(1.0)
    assert rig.firmware.quantities() == twin.firmware.quantities()
    assert rig.bench.sensors.temperature_c != other.bench.sensors.temperature_c


def test_a_board_has_a_serial_number_of_its_own_unless_its_file_gives_one(config):
    from firmware_sim.bench import simulated_device
    from smadrive.devices.device import Device
    from smadrive.modbus.client import ModbusClient

    def serial_number(number):
        board = config.board.model_copy(update={"serial_number": number})
        rig = simulated_device(config.model_copy(update={"board": board}), seed=1)
        device = Device(rig.profile, ModbusClient(rig.transport()))
        return device.read(("serial_number",))["serial_number"].raw

    assert serial_number(None) != serial_number(None)
    assert serial_number(7) == serial_number(7) == 7
