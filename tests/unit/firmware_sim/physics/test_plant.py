"""The plant against exact solutions, conservation of heat, and the vendor's figures."""

from math import exp, pi

import pytest

from firmware_sim.config import load_sim
from firmware_sim.physics.flexinol import flexinol
from firmware_sim.physics.plant import Plant
from firmware_sim.physics.surroundings import Surroundings
from firmware_sim.sensors.sensors import Sensors

CONFIG = load_sim("flexinol-lt-0.15mm")


@pytest.fixture
def plant():
    return Plant(CONFIG)


def until(plant, current_a, done, limit_s=60.0):
    time_s = 0.0
    while not done(plant) and time_s < limit_s:
        plant.advance(current_a, 0.01)
        time_s += 0.01
    return time_s


def test_wire_cools_in_the_time_of_the_vendor_table(plant):
    """The vendor gives 2.0 s: one time constant without transformation, or the return of half the stroke."""
    wire = CONFIG.wire
    assert wire.heat_capacity_j_per_k / wire.loss_w_per_k == pytest.approx(2.0, rel=0.25)
    until(plant, 0.41, lambda p: p.phase > 0.99)
    assert until(plant, 0.0, lambda p: p.phase < 0.5) == pytest.approx(2.0, rel=0.25)


def test_vendor_current_contracts_the_wire_in_about_a_second(plant):
    assert until(plant, 0.41, lambda p: p.phase > 0.9) == pytest.approx(1.0, rel=0.5)


def test_ageing_is_linear_and_permanent(plant):
    plant.ageing.age_wire(shift_c=3.0, over_s=10.0, fade=0.05)
    plant.advance(0.0, 5.0)
    assert (plant.ageing.shift_c, plant.ageing.fade) == pytest.approx((1.5, 0.025))
    plant.advance(0.0, 20.0)
    assert (plant.ageing.shift_c, plant.ageing.fade) == pytest.approx((3.0, 0.05))
    young = Plant(CONFIG)
    for wire, at_c in ((young, 90.0), (plant, 93.0)):
        until(wire, 0.3, lambda one, at_c=at_c: one.temperature_c >= at_c)
    assert plant.phase == pytest.approx(young.phase, abs=0.02)
    assert plant.displacement_mm == pytest.approx(0.95 * CONFIG.wire.stroke_mm * plant.phase)


def settled_c(plant, loss_factor=1.0, ambient_c=CONFIG.wire.ambient_c):
    wire = CONFIG.wire
    return ambient_c + plant.current_a**2 * plant.resistance_ohm / (loss_factor * wire.loss_w_per_k)


def test_draft_multiplies_the_loss_and_ceases(plant):
    plant.surroundings.draft(2.0, for_s=40.0, ramp_s=4.0)
    plant.advance(0.1, 2.0)
    assert plant.surroundings.loss_w_per_k == pytest.approx(1.5 * CONFIG.wire.loss_w_per_k)
    plant.advance(0.1, 37.0)
    assert plant.temperature_c == pytest.approx(settled_c(plant, loss_factor=2.0), abs=1e-3)
    plant.advance(0.1, 3.0)
    assert plant.surroundings.loss_w_per_k == pytest.approx(1.5 * CONFIG.wire.loss_w_per_k)
    plant.advance(0.1, 40.0)
    assert plant.temperature_c == pytest.approx(settled_c(plant), abs=1e-3)


def test_ambient_temperature_drifts(plant):
    plant.surroundings.drift_ambient(8.0, over_s=60.0)
    plant.advance(0.1, 30.0)
    assert plant.surroundings.ambient_c == pytest.approx(CONFIG.wire.ambient_c + 4.0)
    plant.advance(0.1, 60.0)
    assert plant.temperature_c == pytest.approx(settled_c(plant, ambient_c=CONFIG.wire.ambient_c + 8.0), abs=1e-3)


def half_cooled(plant):
    until(plant, 0.41, lambda one: one.temperature_c > 150.0)
    until(plant, 0.0, lambda one: one.phase < 0.5)


@pytest.mark.parametrize("kind", ["dead weight", "spring"])
def test_step_of_the_load_gives_a_wire_of_the_new_load(kind):
    """After both branches were passed, the history of the load has no effect."""
    stiffness = 0.0 if kind == "dead weight" else 0.05
    nominal = flexinol(0.15)
    light = nominal.bias.model_copy(update={"stiffness_n_per_mm": stiffness})
    heavy = light.model_copy(update={"preload_n": light.preload_n + 60.0 * pi * 0.15**2 / 4})
    stepped, new = (Plant(nominal.model_copy(update={"bias": bias})) for bias in (light, heavy))
    half_cooled(stepped)
    phase = stepped.phase
    stepped.load.step_load(60.0)
    stepped.advance(0.0, 0.1)
    assert stepped.phase < phase - 0.1
    for plant in (stepped, new):
        until(plant, 0.41, lambda one: one.temperature_c > 150.0)
        until(plant, 0.0, lambda one: one.temperature_c < 85.0)
    assert stepped.phase == pytest.approx(new.phase, abs=0.02)


@pytest.mark.parametrize("mpa", [60.0, -60.0])
def test_step_of_the_load_conserves_heat(mpa):
    """Without loss, what the transformation gives off warms the wire."""
    plant, wire = Plant(CONFIG), CONFIG.wire
    half_cooled(plant) if mpa > 0.0 else until(plant, 0.3, lambda one: one.phase > 0.5)
    plant.surroundings = Surroundings(wire.ambient_c, 1e-9)
    before_c, phase = plant.temperature_c, plant.phase
    plant.load.step_load(mpa)
    plant.advance(0.0, 0.5)
    assert (phase - plant.phase) * mpa > 5.0
    given_off_j = wire.mass_kg * wire.latent_heat_j_per_kg * (phase - plant.phase)
    assert wire.heat_capacity_j_per_k * (plant.temperature_c - before_c) == pytest.approx(given_off_j, rel=0.05)


def test_temperature_without_transformation_follows_the_exact_solution(plant):
    wire = CONFIG.wire
    plant.advance(0.1, 2.0)
    settled_c = wire.ambient_c + 0.1**2 * wire.resistance_cold_ohm / wire.loss_w_per_k
    decay = exp(-2.0 * wire.loss_w_per_k / wire.heat_capacity_j_per_k)
    assert plant.temperature_c == pytest.approx(settled_c + (wire.ambient_c - settled_c) * decay, abs=1e-3)


def test_heat_is_conserved_through_the_transformation(plant):
    """Electrical heat = stored heat, sensible and latent, plus lost heat."""
    wire, lost_j, put_in_j = CONFIG.wire, 0.0, 0.0
    for _ in range(500):
        before_c, before_ohm = plant.temperature_c, plant.resistance_ohm
        plant.advance(0.35, 0.005)
        put_in_j += 0.35**2 * (before_ohm + plant.resistance_ohm) / 2 * 0.005
        lost_j += wire.loss_w_per_k * ((before_c + plant.temperature_c) / 2 - wire.ambient_c) * 0.005
    latent_j = wire.mass_kg * wire.latent_heat_j_per_kg * plant.phase
    stored_j = wire.heat_capacity_j_per_k * (plant.temperature_c - wire.ambient_c) + latent_j
    assert plant.phase > 0.9
    assert stored_j + lost_j == pytest.approx(put_in_j, rel=0.01)


@pytest.mark.parametrize("name", ["flexinol-lt-0.15mm", "flexinol-ht-0.10mm", "flexinol-lt-0.38mm"])
def test_cooling_returns_the_heat_of_the_transformation(name):
    """Over a whole cycle all electrical heat has left through the surface."""
    config = load_sim(name)
    plant, wire = Plant(config), config.wire
    put_in_j = lost_j = stored_j = 0.0
    for step in range(10_000):
        current_a = 0.75 * config.board.supply_limit_a if plant.temperature_c < 140.0 and step < 2000 else 0.0
        before_c, before_ohm = plant.temperature_c, plant.resistance_ohm
        plant.advance(current_a, 0.01)
        put_in_j += current_a**2 * (before_ohm + plant.resistance_ohm) / 2 * 0.01
        lost_j += wire.loss_w_per_k * ((before_c + plant.temperature_c) / 2 - wire.ambient_c) * 0.01
        stored_j = max(stored_j, wire.mass_kg * wire.latent_heat_j_per_kg * plant.phase)
    left_j = wire.heat_capacity_j_per_k * (plant.temperature_c - wire.ambient_c)
    assert stored_j > 0.99 * wire.mass_kg * wire.latent_heat_j_per_kg
    assert plant.phase < 0.01
    assert lost_j + left_j == pytest.approx(put_in_j, rel=2e-3)


def test_result_hardly_depends_on_the_step_of_the_caller(plant):
    other = Plant(CONFIG)
    for _ in range(100):
        plant.advance(0.4, 0.01)
    other.advance(0.4, 1.0)
    assert other.temperature_c == pytest.approx(plant.temperature_c, abs=0.05)


def test_heating_and_cooling_branches_differ(plant):
    until(plant, 0.4, lambda p: p.phase > 0.5)
    heating_c = plant.temperature_c
    until(plant, 0.4, lambda p: p.phase > 0.999)
    until(plant, 0.0, lambda p: p.phase < 0.5)
    assert heating_c - plant.temperature_c == pytest.approx(89.9 - 69.0, abs=1.0)


def test_resistance_falls_with_the_phase(plant):
    cold_ohm = plant.resistance_ohm
    until(plant, 0.4, lambda p: p.phase > 0.999)
    assert plant.resistance_ohm == pytest.approx(cold_ohm * 0.88, rel=1e-3)


def test_broken_wire_carries_no_current_and_shorted_switch_its_leak(plant):
    plant.faults.break_wire()
    plant.advance(0.5, 0.1)
    assert plant.current_a == 0.0
    plant.faults.mend_heater()
    plant.faults.short_switch(0.2)
    plant.advance(0.0, 0.1)
    assert plant.current_a == 0.2


def test_thermocouple_lags_and_counts_on_when_frozen(plant):
    sensors = Sensors(CONFIG, plant, seed=0)

    def run(current_a, ticks):
        for _ in range(ticks):
            before_c = plant.temperature_c
            plant.advance(current_a, 0.01)
            sensors.advance(before_c, 0.01)

    run(0.2, 200)
    ramp_c_per_s = -(plant.temperature_c - (run(0.2, 1), plant.temperature_c)[1]) / 0.01
    assert plant.temperature_c - sensors.temperature_c == pytest.approx(0.15 * ramp_c_per_s, abs=0.7)
    sensors.faults.freeze_thermocouple()
    frozen_c, count = sensors.temperature_c, sensors.conversions
    run(0.4, 100)
    assert sensors.temperature_c == frozen_c
    assert sensors.conversions == count + 50
    sensors.faults.mend_thermocouple()
    run(0.4, 2)
    assert sensors.temperature_c != frozen_c


def test_readings_are_multiples_of_the_quantum(plant):
    sensors = Sensors(CONFIG, plant, seed=0)
    steps = sensors.temperature_c / CONFIG.thermocouple.quantum_c
    assert steps == pytest.approx(round(steps), abs=1e-6)
