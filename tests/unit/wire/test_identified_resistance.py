"""The resistance over temperature and phase: its inverse, its slope, its spline, and impossible parameters."""

import dataclasses

import numpy as np
import pytest

from smadrive.errors import ModelError
from smadrive.wire.identified_resistance import WireResistance

NODES = tuple(np.linspace(30.0, 120.0, 24).tolist())
WITH_R_PHASE = tuple(14.5 + 0.006 * (c - 70.0) + 0.6 / (1.0 + np.exp((c - 68.0) / 2.0)) for c in NODES)
RESISTANCE = WireResistance(70.0, 17.0, 0.012, 0.04, 0.004, 0.001, 0.01, NODES, WITH_R_PHASE)


@pytest.mark.parametrize("celsius", [25.0, 60.0, 71.3, 110.0, 150.0])
@pytest.mark.parametrize("phase", [-0.05, 0.0, 0.37, 1.0, 1.04])
@pytest.mark.parametrize("start", [0.0, 0.5, 1.0])
def test_phase_inverts_the_resistance(celsius, phase, start):
    assert RESISTANCE.phase(RESISTANCE.ohm(celsius, phase), celsius, start) == pytest.approx(phase, abs=1e-9)


@pytest.mark.parametrize("celsius", [50.0, 90.0])
def test_slope_is_the_derivative(celsius):
    numeric = (RESISTANCE.ohm(celsius, 0.6001) - RESISTANCE.ohm(celsius, 0.5999)) / 2e-4
    assert RESISTANCE.ohm_per_phase(celsius, 0.6) == pytest.approx(numeric, rel=1e-6)


def test_spline_passes_its_nodes_and_continues_straight():
    shrunk = 0.96**2
    for node_c, ohm in zip(NODES, WITH_R_PHASE, strict=True):
        assert RESISTANCE.ohm(node_c, 1.0) == pytest.approx(shrunk * ohm, rel=1e-12)
    beyond = [RESISTANCE.ohm(c, 1.0) for c in (130.0, 140.0, 150.0)]
    assert beyond[2] - beyond[1] == pytest.approx(beyond[1] - beyond[0])


def test_no_phase_where_the_resistance_does_not_depend_on_it():
    flat = WireResistance(70.0, 17.0, 0.0, 0.0, 0.004, 0.001, 0.0, NODES, (17.0,) * len(NODES))
    assert np.isnan(flat.phase(17.0, 80.0, 0.5))


@pytest.mark.parametrize(("place", "node_c"), [(0, -5000.0), (-1, 5000.0)])
def test_node_out_of_its_range_is_named(place, node_c):
    nodes = list(NODES)
    nodes[place] = node_c
    with pytest.raises(ModelError) as raised:
        dataclasses.replace(RESISTANCE, nodes_c=tuple(nodes))
    assert raised.value.value == f"{node_c:g} °C"


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("martensite_ohm", -1.0),
        ("martensite_ohm_per_k", float("nan")),
        ("strain", 1.5),
        ("noise_v", -0.1),
        ("nodes_c", (1.0, 1.0, 2.0)),
        ("austenite_ohm", (0.0,) * len(NODES)),
        ("noise_v", 0.0),
        ("delay_s", 1e6),
        ("strain", 0.9),
        ("nodes_c", tuple(5000.0 + c for c in NODES)),
    ],
)
def test_impossible_parameters_are_named(name, value):
    with pytest.raises(ModelError) as raised:
        dataclasses.replace(RESISTANCE, **{name: value})
    assert raised.value.where == f"resistance: {name}"


def test_austenite_that_jumps_between_two_nodes_is_named():
    jumping = dataclasses.replace(RESISTANCE, austenite_ohm=tuple(14.5 + 2.0 * (n % 2) for n in range(len(NODES))))
    with pytest.raises(ModelError) as raised:
        jumping.check_change()
    assert raised.value.where == "resistance: austenite_ohm"


@pytest.mark.parametrize("factor", [0.4, 2.0, 17.0 / 14.5])
def test_resistance_that_no_alloy_has_or_that_does_not_change_is_named(factor):
    austenite_ohm = tuple(factor * 14.5 for _ in NODES)
    absurd = dataclasses.replace(RESISTANCE, martensite_ohm_per_k=0.0, strain=0.0, austenite_ohm=austenite_ohm)
    RESISTANCE.check_change()
    with pytest.raises(ModelError) as raised:
        absurd.check_change()
    assert raised.value.where == "resistance: austenite_ohm"
