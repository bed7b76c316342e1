"""The resistance of the simulated wire: both phases, temperature, geometry, R-phase, leads, and the old formula."""

import pytest

from firmware_sim.config import Resistance, RPhase, load_sim
from firmware_sim.physics.plant import Plant
from firmware_sim.physics.resistance import WireResistance
from firmware_sim.sensors.sensors import Sensors

SIM = load_sim("flexinol-lt-0.15mm")
WIRE = SIM.wire
WARM = Resistance(martensite_per_k=0.8e-3, austenite_per_k=0.5e-3, strain=0.04)


@pytest.mark.parametrize("phase", [0.0, 0.3, 1.0])
def test_without_dependence_only_the_phase_matters(phase):
    resistance = WireResistance(WIRE, None)
    expected = WIRE.resistance_cold_ohm * (1.0 + WIRE.resistance_change * phase)
    assert {resistance.ohm(celsius, phase, phase) for celsius in (20.0, 90.0)} == {expected}


def test_ends_of_the_stroke_at_the_reference_temperature():
    resistance = WireResistance(WIRE, WARM)
    assert resistance.ohm(WIRE.ambient_c, 0.0, 0.0) == pytest.approx(WIRE.resistance_cold_ohm)
    hot = WIRE.resistance_cold_ohm * (1.0 + WIRE.resistance_change)
    assert resistance.ohm(WIRE.ambient_c, 1.0, 1.0) == pytest.approx(hot)


@pytest.mark.parametrize(("phase", "per_k"), [(0.0, WARM.martensite_per_k), (1.0, WARM.austenite_per_k)])
def test_each_phase_has_its_temperature_coefficient(phase, per_k):
    resistance = WireResistance(WIRE, WARM)
    cold, warm = (resistance.ohm(WIRE.ambient_c + more, phase, phase) for more in (0.0, 50.0))
    assert warm / cold == pytest.approx(1.0 + 50.0 * per_k)


def test_stretched_wire_is_longer_and_thinner():
    resistance = WireResistance(WIRE, WARM)
    short, stretched = resistance.ohm(90.0, 1.0, 1.0), resistance.ohm(90.0, 1.0, 0.0)
    assert stretched / short == pytest.approx(1.04**2)


def test_r_phase_raises_the_resistance_of_cool_austenite_only():
    r_phase = RPhase(rise=0.05, centre_c=70.0, sigma_c=3.0)
    with_hump, without = (WireResistance(WIRE, one) for one in (Resistance(r_phase=r_phase), None))
    assert with_hump.ohm(50.0, 1.0, 1.0) == pytest.approx(1.05 * without.ohm(50.0, 1.0, 1.0))
    assert with_hump.ohm(90.0, 1.0, 1.0) == pytest.approx(without.ohm(90.0, 1.0, 1.0))
    assert with_hump.ohm(50.0, 0.0, 0.0) == without.ohm(50.0, 0.0, 0.0)


def test_leads_add_voltage_and_no_heat():
    sense = SIM.sense.model_copy(update={"lead_ohm": 0.5})
    with_leads, without = Plant(SIM.model_copy(update={"sense": sense})), Plant(SIM)
    for plant in (with_leads, without):
        plant.advance(0.2, 0.5)
    assert with_leads.temperature_c == without.temperature_c
    with_leads.advance(0.2, 0.0)
    without.advance(0.2, 0.0)
    assert with_leads.voltage_v - without.voltage_v == pytest.approx(0.2 * 0.5)


def test_coarse_converter_shows_multiples_of_its_quantum():
    sense = SIM.sense.model_copy(update={"current_quantum_a": 0.01, "voltage_quantum_v": 0.1})
    config = SIM.model_copy(update={"sense": sense})
    plant = Plant(config)
    sensors = Sensors(config, plant, seed=1)
    plant.advance(0.234, 0.01)
    sensors.advance(plant.temperature_c, 0.01)
    assert sensors.current_a == pytest.approx(0.23)
    assert sensors.voltage_v == pytest.approx(3.9)
