"""Plants drawn at random: within their bounds, of every kind, the same for the same seed, and wires that work."""

from collections import Counter

import pytest

from firmware_sim.config import load_sim
from firmware_sim.physics.plant import Plant
from firmware_sim.physics.random_wire import KINDS, draw

NOMINAL = load_sim("flexinol-lt-0.15mm")


@pytest.fixture(scope="module")
def drawn():
    return [draw(NOMINAL, seed) for seed in range(40)]


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
def test_they_fill_their_bounds(drawn, value, share):
    ratios = [value(config) / value(NOMINAL) for config in drawn]
    low, high = min(ratios), max(ratios)
    assert 1 - share <= low < 1 - 0.8 * share
    assert 1 + 0.8 * share < high <= 1 + share


def test_temperatures_lag_and_noise_lie_within_theirs(drawn):
    for config in drawn:
        loop, nominal = config.transformation, NOMINAL.transformation
        assert abs(loop.mu_heating_c - nominal.mu_heating_c) <= 5.0
        assert abs(loop.mu_cooling_c - nominal.mu_cooling_c) <= 5.0
        assert 0.05 <= config.thermocouple.lag_s <= 0.25
        assert config.thermocouple.noise_c == 0.1


def test_every_kind_is_among_them_unless_one_is_asked_for(drawn):
    counts = Counter(config.transformation.kind for config in drawn)
    assert set(counts) == set(KINDS)
    assert counts["duhem"] > max(counts["two-component"], counts["preisach"]) > 5
    assert draw(NOMINAL, 5, "preisach").transformation.kind == "preisach"


def test_the_seed_decides(drawn):
    assert draw(NOMINAL, 3) == drawn[3]
    assert len({config.model_dump_json() for config in drawn}) == len(drawn)


@pytest.mark.parametrize("name", ["flexinol-lt-0.15mm", "flexinol-ht-0.10mm", "flexinol-lt-0.38mm"])
@pytest.mark.parametrize("kind", KINDS)
def test_they_contract_and_relax(name, kind):
    config = draw(load_sim(name), 7, kind)
    plant = Plant(config)
    assert plant.phase < 0.01
    steps = 0
    while plant.phase < 0.98:
        plant.advance(0.75 * config.board.supply_limit_a, 0.01)
        steps += 1
        assert steps < 1000
    plant.advance(0.0, 60.0)
    assert plant.phase < 0.01
