"""Faults of the sensors and the heater: what each does to the readings, that it ends, and that a script finds it."""

import pytest

from firmware_sim.bench import SimulatedBench
from firmware_sim.fault_script import load_script
from smadrive.devices.profile.profile import load_profile


@pytest.fixture
def bench(config):
    """A wire that a supply heats with 0.25 A, hot and nearly settled."""
    bench = SimulatedBench(config, seed=1)
    bench.attach(load_profile("riden-rd60xx"), name="supply")
    bench.devices[0].firmware.write({"heater_current": 0.25, "heater_voltage": 12.0, "heater_enable": 1})
    bench.advance_to(20.0)
    return bench


def watch(bench, duration_s, value):
    """`value` of the bench every 20 ms for a while."""
    end_s, values = bench.time_s + duration_s, []
    while bench.time_s < end_s - 1e-9:
        bench.advance_to(bench.time_s + 0.02)
        values.append(value(bench))
    return values


def temperature_c(bench):
    return bench.sensors.temperature_c


def misreading_c(bench):
    return bench.sensors.temperature_c - bench.plant.temperature_c


def test_each_ends_by_itself_or_when_its_thing_is_mended(bench):
    faults = bench.sensors.faults
    faults.freeze_thermocouple(for_s=1.0)
    faults.stick_displacement()
    bench.plant.faults.open_switch(for_s=2.0)
    bench.advance_to(20.99)
    assert (faults.thermocouple.name, faults.displacement.name) == ("frozen", "stuck")
    assert bench.plant.current_a == 0.0
    bench.advance_to(21.0)
    assert (faults.thermocouple.name, faults.displacement.name) == ("none", "stuck")
    bench.advance_to(22.01)
    assert bench.plant.current_a == pytest.approx(0.25)
    faults.mend_displacement()
    assert faults.displacement.name == "none"


def test_a_drifting_thermocouple_goes_away_at_its_rate(bench):
    bench.sensors.faults.drift_thermocouple(2.0)
    assert watch(bench, 5.0, misreading_c)[-1] == pytest.approx(10.0, abs=0.5)
    bench.sensors.faults.mend_thermocouple()
    assert watch(bench, 0.1, misreading_c)[-1] == pytest.approx(0.0, abs=0.5)


def test_a_spiking_one_is_off_now_and_then(bench):
    bench.sensors.faults.spike_thermocouple(40.0, share=0.1)
    spikes = [error_c for error_c in watch(bench, 20.0, misreading_c) if error_c > 5.0]
    assert spikes == pytest.approx([40.0] * len(spikes), abs=1.0)
    assert 60 < len(spikes) < 140


def test_a_reversed_one_reads_the_colder_the_hotter_it_is(bench):
    junction_c = bench.sensors.cold_junction_c
    excess_c = bench.plant.temperature_c - junction_c
    bench.sensors.faults.reverse_thermocouple()
    assert watch(bench, 0.1, temperature_c)[-1] == pytest.approx(junction_c - excess_c, abs=1.0)


def test_a_bridged_one_reads_the_cold_junction_and_no_bit_tells(bench):
    bench.sensors.faults.bridge_thermocouple()
    assert watch(bench, 0.1, temperature_c)[-1] == pytest.approx(bench.sensors.cold_junction_c, abs=0.01)
    assert bench.sensors.unreadable is None


def test_a_displacement_that_sticks_or_spikes(bench):
    def sample(bench):
        return bench.sensors.displacement_mm()

    bench.sensors.displacement_mm()
    bench.sensors.faults.stick_displacement()
    bench.plant.faults.open_switch()
    assert len(set(watch(bench, 5.0, sample))) == 1
    assert bench.plant.displacement_mm < 0.5
    bench.sensors.faults.spike_displacement(3.0, share=0.5)
    assert len([value for value in watch(bench, 4.0, sample) if value > 2.0]) == pytest.approx(100, abs=30)


def test_a_weak_heater_drives_half(bench):
    bench.plant.faults.weaken_current()
    assert watch(bench, 0.1, lambda bench: bench.plant.current_a)[-1] == pytest.approx(0.125)


def shown(bench):
    quantities = bench.devices[0].firmware.quantities()
    return quantities["measured_current"], quantities["measured_voltage"], quantities["regulation"]


def test_a_supply_at_its_voltage_limit_shows_it(bench):
    assert shown(bench)[2] == "cc"
    bench.plant.faults.limit_voltage(2.0)
    current_a, voltage_v, regulation = watch(bench, 0.1, shown)[-1]
    assert voltage_v == pytest.approx(2.0, abs=0.01)
    assert current_a == pytest.approx(2.0 / bench.plant.resistance_ohm, abs=0.002)
    assert regulation == "cv"


def test_a_corroded_contact_takes_voltage_but_does_not_heat_the_wire(bench):
    hot_c = bench.plant.temperature_c
    bench.plant.faults.corrode_contact(10.0)
    current_a, voltage_v, regulation = watch(bench, 1.0, shown)[-1]
    assert regulation == "cc"
    assert voltage_v / current_a == pytest.approx(bench.plant.resistance_ohm + 10.0, rel=0.02)
    assert bench.plant.temperature_c == pytest.approx(hot_c, abs=0.5)
    bench.plant.faults.corrode_contact(100.0)
    assert watch(bench, 0.1, shown)[-1][2] == "cv"


def test_a_supply_on_a_broken_wire_shows_its_voltage_limit_and_no_current(bench):
    bench.plant.faults.break_wire()
    current_a, voltage_v, regulation = watch(bench, 0.1, shown)[-1]
    assert current_a == pytest.approx(0.0, abs=0.001)
    assert voltage_v == pytest.approx(12.0, abs=0.01)
    assert regulation == "cv"


def test_a_brown_out_lets_the_wire_cool_and_the_device_start_anew(bench):
    hot_c, (device,) = bench.plant.temperature_c, bench.devices
    known = bench.known_faults()
    known["supply.brown_out"](for_s=3.0)
    request = bytes.fromhex("01 03 00 12 00 01 24 0F")  # the output
    assert watch(bench, 2.9, lambda bench: device.line.receive(request, bench.time_s))[-1] == []
    assert bench.plant.temperature_c < hot_c - 20.0
    bench.advance_to(24.0)
    ((_, reply),) = device.line.receive(request, bench.time_s)
    assert reply[3:5] == b"\0\0"
    assert device.firmware.current_a == 0.0


def test_a_script_finds_them_with_their_parameters(bench, tmp_path):
    path = tmp_path / "faults.toml"
    path.write_text(
        """
        [[faults]]
        at_s = 21.0
        name = "drift_thermocouple"
        rate_c_per_s = -1.5
        for_s = 2.0
        [[faults]]
        at_s = 21.5
        name = "corrode_contact"
        contact_ohm = 3.0
        """,
        encoding="utf-8",
    )
    bench.follow_script(load_script(path))
    bench.advance_to(22.5)
    assert misreading_c(bench) == pytest.approx(-2.25, abs=0.5)
    assert bench.plant.faults.circuit.contact_ohm == 3.0
    bench.advance_to(23.1)
    assert bench.sensors.faults.thermocouple.name == "none"


@pytest.mark.parametrize("fault", ["spike_thermocouple", "spike_displacement"])
def test_spikes_are_those_of_the_seed(config, fault):
    def readings(seed):
        bench = SimulatedBench(config, seed=seed)
        bench.known_faults()[fault](50.0, share=0.2)
        return watch(bench, 2.0, lambda bench: (bench.sensors.temperature_c, bench.sensors.displacement_mm()))

    assert readings(1) == readings(1)
    assert readings(1) != readings(2)
