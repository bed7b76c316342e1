"""Simulated Flexinol of every diameter against the vendor's table."""

import pytest

from firmware_sim.config import load_sim
from firmware_sim.physics.flexinol import TABLE, flexinol, still_air
from firmware_sim.physics.plant import Plant
from smadrive.errors import ConfigError
from smadrive.files.shipped import configs_dir

COOLING_S = {  # diameter: (LT, HT)
    0.025: (0.18, 0.15),
    0.05: (0.4, 0.3),
    0.076: (0.8, 0.7),
    0.10: (1.1, 0.9),
    0.15: (2.0, 1.7),
    0.20: (3.2, 2.7),
    0.25: (5.4, 4.5),
    0.31: (8.1, 6.8),
    0.38: (10.5, 8.8),
    0.51: (16.8, 14.0),
}
RELAXED = 0.5 / 4.0  # the vendor does not count the last 0.5 % of a strain of 4 %


@pytest.mark.parametrize("alloy", ["LT", "HT"])
@pytest.mark.parametrize("diameter_mm", TABLE)
def test_wire_cools_in_the_time_of_the_vendor_table(diameter_mm, alloy):
    check_cooling(flexinol(diameter_mm, alloy=alloy), diameter_mm, alloy)


@pytest.mark.parametrize("path", sorted((configs_dir() / "sims").glob("*.toml")), ids=lambda path: path.stem)
def test_shipped_wire_cools_in_the_time_of_the_vendor_table(path):
    _, alloy, diameter = path.stem.removesuffix("mm").split("-")
    check_cooling(load_sim(path), float(diameter), alloy.upper())


def check_cooling(config, diameter_mm, alloy):
    """Compare the time from contraction until the stroke has returned."""
    vendor_s = COOLING_S[diameter_mm][alloy == "HT"]
    step_s = vendor_s / 500
    plant = Plant(config)
    while plant.phase < 0.99:
        plant.advance(1.5 * TABLE[diameter_mm].contracting_a, step_s)
    steps = 0
    while plant.phase > RELAXED:
        plant.advance(0.0, step_s)
        steps += 1
    assert steps * step_s == pytest.approx(vendor_s, rel=0.25)


@pytest.mark.parametrize("diameter_mm", TABLE)
def test_vendor_current_contracts_the_wire(diameter_mm):
    plant = Plant(flexinol(diameter_mm))
    for _ in range(200):
        plant.advance(TABLE[diameter_mm].contracting_a, 0.01)
    assert plant.phase > 0.9


@pytest.mark.parametrize(
    ("diameter_mm", "h_w_per_m2_k"), [(0.076, 172.0), (0.10, 137.0), (0.15, 99.0), (0.20, 85.0), (0.51, 50.0)]
)
def test_convection_agrees_with_the_published_correlation(diameter_mm, h_w_per_m2_k):
    surface_m = 3.14159e-3 * diameter_mm
    assert still_air(diameter_mm * 1e-3, 58.0).loss_w_per_m_k == pytest.approx(h_w_per_m2_k * surface_m, rel=0.02)


def test_wire_parameters_are_proportional_to_the_length():
    short, long = flexinol(0.2, length_m=0.1).wire, flexinol(0.2, length_m=0.2).wire
    for name in ("heat_capacity_j_per_k", "loss_w_per_k", "mass_kg", "resistance_cold_ohm", "stroke_mm"):
        assert getattr(long, name) == pytest.approx(2 * getattr(short, name))


@pytest.mark.parametrize(
    ("name", "config"),
    [("flexinol-ht-0.10mm", flexinol(0.10, alloy="HT")), ("flexinol-lt-0.38mm", flexinol(0.38))],
)
def test_shipped_wires_agree_with_the_formulas(name, config):
    shipped, wire = load_sim(name), config.wire.model_dump()
    for key, value in shipped.wire.model_dump(exclude={"resistance_change"}).items():
        assert value == pytest.approx(wire[key], rel=0.005), key
    assert shipped.board == config.board
    assert shipped.transformation.mu_heating_c == config.transformation.mu_heating_c


def test_unknown_diameter_is_rejected():
    with pytest.raises(ConfigError) as error:
        flexinol(0.3)
    assert error.value.value == "0.3 mm"
    assert "0.025, 0.05" in error.value.cure
