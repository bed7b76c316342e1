"""Faults of the heater circuit, and their effect on the readings of a supply."""

import pytest


def readings(bench):
    quantities = bench.devices[0].firmware.quantities()
    return quantities["measured_current"], quantities["measured_voltage"], quantities["regulation"]


def test_weakened_current_is_half_by_default(bench, watch):
    bench.plant.faults.weaken_current()
    assert watch(bench, 0.1, lambda bench: bench.plant.current_a)[-1] == pytest.approx(0.125)


def test_fault_ends_after_its_time(bench):
    bench.plant.faults.open_switch(for_s=2.0)
    bench.advance_to(21.0)
    assert bench.plant.current_a == 0.0
    bench.advance_to(22.01)
    assert bench.plant.current_a == pytest.approx(0.25)


def test_supply_at_its_voltage_limit_shows_constant_voltage(bench, watch):
    assert readings(bench)[2] == "cc"
    bench.plant.faults.limit_voltage(2.0)
    current_a, voltage_v, regulation = watch(bench, 0.1, readings)[-1]
    assert voltage_v == pytest.approx(2.0, abs=0.01)
    assert current_a == pytest.approx(2.0 / bench.plant.resistance_ohm, abs=0.002)
    assert regulation == "cv"


def test_corroded_contact_takes_voltage_but_does_not_heat_the_wire(bench, watch):
    hot_c = bench.plant.temperature_c
    bench.plant.faults.corrode_contact(10.0)
    current_a, voltage_v, regulation = watch(bench, 1.0, readings)[-1]
    assert regulation == "cc"
    assert voltage_v / current_a == pytest.approx(bench.plant.resistance_ohm + 10.0, rel=0.02)
    assert bench.plant.temperature_c == pytest.approx(hot_c, abs=0.5)
    bench.plant.faults.corrode_contact(100.0)
    assert watch(bench, 0.1, readings)[-1][2] == "cv"


def test_supply_on_a_broken_wire_shows_its_voltage_limit_and_no_current(bench, watch):
    bench.plant.faults.break_wire()
    current_a, voltage_v, regulation = watch(bench, 0.1, readings)[-1]
    assert current_a == pytest.approx(0.0, abs=0.001)
    assert voltage_v == pytest.approx(12.0, abs=0.01)
    assert regulation == "cv"
