"""Random plants: within their bounds, of every kind, the same for the same seed, and able to work."""

from collections import Counter

import pytest

from firmware_sim.config import load_sim
from firmware_sim.physics.plant import Plant
from firmware_sim.physics.random_wire import KINDS, random_wire

NOMINAL = load_sim("flexinol-lt-0.15mm")


@pytest.fixture(scope="module")
def wires():
    return [random_wire(NOMINAL, seed) for seed in range(40)]


@pytest.mark.parametrize(
    ("value", "share"),
    [
        (lambda config: config.wire.heat_capacity_j_per_k, 0.25),
        (lambda config: config.wire.loss_w_per_k, 0.25),
        (lambda config: config.wire.latent_heat_j_per_kg, 0.25),
        (lambda config: config.wire.resistance_cold_ohm, 0.05),
        (lambda config: config.wire.stroke_mm, 0.10),
        (lambda config: config.transformation.sigma_heating_c, 0.25),
        (lambda config: config.transformation.sigma_cooling_c, 0.25),
    ],
)
def test_parameters_fill_their_bounds(wires, value, share):
    ratios = [value(config) / value(NOMINAL) for config in wires]
    low, high = min(ratios), max(ratios)
    assert 1 - share <= low < 1 - 0.8 * share
    assert 1 + 0.8 * share < high <= 1 + share


def test_temperatures_lag_and_noise_are_within_their_bounds(wires):
    for config in wires:
        loop, nominal = config.transformation, NOMINAL.transformation
        assert abs(loop.mu_heating_c - nominal.mu_heating_c) <= 5.0
        assert abs(loop.mu_cooling_c - nominal.mu_cooling_c) <= 5.0
        assert 0.05 <= config.thermocouple.lag_s <= 0.25
        assert config.thermocouple.noise_c == 0.1


def test_resistance_varies_in_every_respect(wires):
    assert all(0.7 <= config.wire.resistance_change / NOMINAL.wire.resistance_change <= 1.3 for config in wires)
    assert all(0.005 <= config.sense.lead_ohm / config.wire.resistance_cold_ohm <= 0.03 for config in wires)
    with_r_phase = sum(config.resistance.r_phase is not None for config in wires)
    assert 3 < with_r_phase < 20


def test_other_values_of_a_seed_do_not_depend_on_the_resistance(wires):
    assert wires[3].wire.heat_capacity_j_per_k == pytest.approx(0.0258957, rel=1e-5)
    assert wires[3].transformation.mu_heating_c == pytest.approx(93.2747, rel=1e-5)


def test_kinds_are_mixed_unless_one_is_given(wires):
    counts = Counter(config.transformation.kind for config in wires)
    assert set(counts) == set(KINDS)
    assert counts["duhem"] > max(counts["two-component"], counts["preisach"]) > 5
    assert random_wire(NOMINAL, 5, "preisach").transformation.kind == "preisach"


def test_same_seed_gives_same_wire(wires):
    assert random_wire(NOMINAL, 3) == wires[3]
    assert len({config.model_dump_json() for config in wires}) == len(wires)


@pytest.mark.parametrize("name", ["flexinol-lt-0.15mm", "flexinol-ht-0.10mm", "flexinol-lt-0.38mm"])
@pytest.mark.parametrize("kind", KINDS)
def test_random_wire_contracts_and_relaxes(name, kind):
    config = random_wire(load_sim(name), 7, kind)
    plant = Plant(config)
    assert plant.phase < 0.01
    steps = 0
    while plant.phase < 0.98:
        plant.advance(0.75 * config.board.supply_limit_a, 0.01)
        steps += 1
        assert steps < 1000
    plant.advance(0.0, 60.0)
    assert plant.phase < 0.01
