"""The transformation of a wire: its kinds, and the effect of a weight or a spring."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from firmware_sim.config import Bias, Transformation
from firmware_sim.physics.transformation import LoadedTransformation
from smadrive.errors import ConfigError
from smadrive.files.config import validate

BRANCHES = {
    "mu_heating_c": 77.6,
    "mu_cooling_c": 55.5,
    "sigma_heating_c": 5.0,
    "sigma_cooling_c": 5.0,
    "range_c": (0.0, 250.0),
}
R_PHASE = {"share": 0.2, "mu_heating_c": 74.0, "mu_cooling_c": 66.0, "sigma_heating_c": 3.0, "sigma_cooling_c": 3.0}
KINDS = [
    BRANCHES,
    BRANCHES | {"kind": "two-component", "second": R_PHASE},
    BRANCHES | {"kind": "preisach", "correlation": 0.6},
]
AREA_MM2 = np.pi * 0.15**2 / 4
PULLS = {"diameter_mm": 0.15, "heating_mpa_per_k": 8.0, "cooling_mpa_per_k": 7.0}
WEIGHT = Bias(preload_n=140.0 * AREA_MM2, **PULLS)
SPRING = Bias(preload_n=70.0 * AREA_MM2, stiffness_n_per_mm=10.0 * AREA_MM2, **PULLS)


def loaded(tables, bias=None):
    return LoadedTransformation(Transformation.model_validate(tables), bias, stroke_mm=12.0, ambient_c=22.0)


def sweep(wire, temperatures_c):
    phases = []
    for temperature_c in temperatures_c:
        wire.move_to(float(temperature_c))
        phases.append(wire.phase)
    return np.array(phases)


def at_half(wire):
    """The temperatures at phase 0.5 of the major loop, up and down."""
    up, down = np.linspace(22.0, 160.0, 1381), np.linspace(160.0, 22.0, 1381)
    rising, falling = sweep(wire, up), sweep(wire, down)
    return np.interp(0.5, rising, up), np.interp(0.5, falling[::-1], down[::-1])


@pytest.mark.parametrize("tables", KINDS, ids=lambda tables: tables.get("kind", "duhem"))
def test_weight_shifts_the_branches_by_clausius_clapeyron(tables):
    plain, pulled = at_half(loaded(tables)), at_half(loaded(tables, WEIGHT))
    assert pulled[0] - plain[0] == pytest.approx(140.0 / 8.0, abs=0.1)
    assert pulled[1] - plain[1] == pytest.approx(140.0 / 7.0, abs=0.1)


@pytest.mark.parametrize("tables", KINDS, ids=lambda tables: tables.get("kind", "duhem"))
def test_spring_shifts_the_branches_by_its_stress_at_that_phase(tables):
    """At half of 12 mm the spring adds 60 MPa."""
    plain, pulled = at_half(loaded(tables)), at_half(loaded(tables, SPRING))
    assert pulled[0] - plain[0] == pytest.approx(130.0 / 8.0, abs=0.1)
    assert pulled[1] - plain[1] == pytest.approx(130.0 / 7.0, abs=0.1)


@pytest.mark.parametrize("tables", KINDS, ids=lambda tables: tables.get("kind", "duhem"))
@settings(max_examples=20, deadline=None)
@given(path=st.lists(st.floats(20.0, 160.0), min_size=1, max_size=8))
def test_phase_against_a_spring_follows_the_temperature(tables, path):
    wire = loaded(tables, SPRING)
    before, before_c = wire.phase, 22.0
    for target_c in path:
        wire.move_to(target_c)
        assert -1e-9 <= wire.phase <= 1 + 1e-9
        assert (wire.phase - before) * (target_c - before_c) >= -1e-9
        before, before_c = wire.phase, target_c


@pytest.mark.parametrize("tables", KINDS, ids=lambda tables: tables.get("kind", "duhem"))
@pytest.mark.parametrize("bias", [None, WEIGHT, SPRING], ids=["plain", "weight", "spring"])
def test_large_moves_and_slopes_agree_with_small_steps(tables, bias):
    small, large = loaded(tables, bias), loaded(tables, bias)
    for start_c, end_c in ((22.0, 92.1), (92.1, 78.1), (78.1, 97.1), (97.1, 70.1)):
        sweep(small, np.linspace(start_c, end_c, 2000)[1:])
        large.move_to(end_c)
        assert large.phase == pytest.approx(small.phase, abs=1e-4)
        direction = 1 if end_c > start_c else -1
        slope, before = large.slope(rising=direction > 0), large.phase
        large.move_to(end_c + direction * 1e-3)
        assert slope == pytest.approx((large.phase - before) / (direction * 1e-3), rel=0.02, abs=1e-4)
        small.move_to(end_c + direction * 1e-3)
        large.move_to(end_c)
        small.move_to(end_c)


def test_second_component_transforms_at_its_own_temperatures():
    one, two = loaded(KINDS[0]), loaded(KINDS[1])
    temperatures_c = [95.0, 66.0]
    assert sweep(two, temperatures_c)[1] == pytest.approx(sweep(one, temperatures_c)[1] - 0.2 * 0.48, abs=0.02)


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"kind": "preisahc"}, ("kind: ",)),
        ({"kind": "preisach"}, ("'preisach'", "correlation")),
        ({"correlation": 0.5}, ("'preisach'", "correlation")),
        ({"kind": "two-component"}, ("'two-component'", "second")),
        ({"kind": "preisach", "correlation": 1.0}, ("correlation: ", "less than 1")),
        ({"range_c": (10.0, 5.0)}, ("range_c",)),
    ],
)
def test_kind_without_its_key_is_rejected(change, named):
    with pytest.raises(ConfigError) as error:
        validate(BRANCHES | change, Transformation, "sim.toml")
    assert error.value.where == "sim.toml"
    assert all(part in error.value.what for part in named)
