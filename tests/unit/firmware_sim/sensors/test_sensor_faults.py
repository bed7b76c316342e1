"""Faults of the sensors: their effect on the readings, their end, and their use in a script."""

import pytest

from firmware_sim.bench import SimulatedBench
from firmware_sim.fault_script import load_script


def temperature_c(bench):
    return bench.sensors.temperature_c


def error_c(bench):
    return bench.sensors.temperature_c - bench.plant.temperature_c


def test_fault_ends_after_its_time_or_when_mended(bench):
    faults = bench.sensors.faults
    faults.freeze_thermocouple(for_s=1.0)
    faults.stick_displacement()
    bench.advance_to(20.99)
    assert (faults.thermocouple.name, faults.displacement.name) == ("frozen", "stuck")
    bench.advance_to(21.0)
    assert (faults.thermocouple.name, faults.displacement.name) == ("none", "stuck")
    faults.mend_displacement()
    assert faults.displacement.name == "none"


def test_drifting_thermocouple_drifts_at_its_rate(bench, watch):
    bench.sensors.faults.drift_thermocouple(2.0)
    assert watch(bench, 5.0, error_c)[-1] == pytest.approx(10.0, abs=0.5)
    bench.sensors.faults.mend_thermocouple()
    assert watch(bench, 0.1, error_c)[-1] == pytest.approx(0.0, abs=0.5)


def test_share_of_the_readings_of_a_spiking_thermocouple_is_off(bench, watch):
    bench.sensors.faults.spike_thermocouple(40.0, share=0.1)
    spikes = [value_c for value_c in watch(bench, 20.0, error_c) if value_c > 5.0]
    assert spikes == pytest.approx([40.0] * len(spikes), abs=1.0)
    assert 60 < len(spikes) < 140


def test_reading_of_a_reversed_thermocouple_falls_when_the_wire_heats(bench, watch):
    junction_c = bench.sensors.cold_junction_c
    excess_c = bench.plant.temperature_c - junction_c
    bench.sensors.faults.reverse_thermocouple()
    assert watch(bench, 0.1, temperature_c)[-1] == pytest.approx(junction_c - excess_c, abs=1.0)


def test_bridged_thermocouple_reads_the_cold_junction_without_a_fault_bit(bench, watch):
    bench.sensors.faults.bridge_thermocouple()
    assert watch(bench, 0.1, temperature_c)[-1] == pytest.approx(bench.sensors.cold_junction_c, abs=0.01)
    assert bench.sensors.unreadable is None


def test_displacement_sticks_or_spikes(bench, watch):
    def sample(bench):
        return bench.sensors.displacement_mm()

    bench.sensors.displacement_mm()
    bench.sensors.faults.stick_displacement()
    bench.plant.faults.open_switch()
    assert len(set(watch(bench, 5.0, sample))) == 1
    assert bench.plant.displacement_mm < 0.5
    bench.sensors.faults.spike_displacement(3.0, share=0.5)
    assert len([value for value in watch(bench, 4.0, sample) if value > 2.0]) == pytest.approx(100, abs=30)


def test_script_sets_faults_with_their_parameters(bench, tmp_path):
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
    assert error_c(bench) == pytest.approx(-2.25, abs=0.5)
    assert bench.plant.faults.circuit.contact_ohm == 3.0
    bench.advance_to(23.1)
    assert bench.sensors.faults.thermocouple.name == "none"


@pytest.mark.parametrize("fault", ["spike_thermocouple", "spike_displacement"])
def test_spikes_depend_on_the_seed_alone(config, watch, fault):
    def readings(seed):
        bench = SimulatedBench(config, seed=seed)
        bench.known_faults()[fault](50.0, share=0.2)
        return watch(bench, 2.0, lambda bench: (bench.sensors.temperature_c, bench.sensors.displacement_mm()))

    assert readings(1) == readings(1)
    assert readings(1) != readings(2)
