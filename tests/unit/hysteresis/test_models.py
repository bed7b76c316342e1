"""Parameters that are no model are refused by name, value and cure; rules say what they are."""

import numpy as np
import pytest

from smadrive.errors import DataError, ModelError
from smadrive.hysteresis import DuhemModel, GaussianMixture, GaussianSets, TrapezoidSets, TriangularSets, TSFuzzyDuhem

from .conftest import MODELS, PAPER

GAUSSIAN = {"mu_heating": 90, "mu_cooling": 70, "sigma_heating": 5, "sigma_cooling": 5, "input_range": (20, 140)}
LAWS = {"a_heating": [-1, -1], "b_heating": [0, 1], "a_cooling": [1, 1], "b_cooling": [0, -1]}


def test_the_printed_table_is_refused_with_the_reason():
    with pytest.raises(ModelError, match=r"Table 1 as printed.*table1\(\)"):
        DuhemModel.gaussian(
            mu_heating=75, mu_cooling=70, sigma_heating=35, sigma_cooling=-45, scale=40, input_range=(-300, 300)
        )


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"sigma_cooling": -5}, "sigma = -5.0"),
        ({"sigma_heating": float("nan")}, "sigma = nan"),
        ({"sigma_heating": 30}, "branches cross at v = 66"),
        ({"mu_heating": 60}, "mu_heating = 60 must exceed mu_cooling = 70"),
        ({"input_range": (140, 20)}, "increasing"),
        ({"input_range": (1000, 2000)}, "no part of the loop"),
        ({"scale": 0}, "scale is 0"),
        ({"offset": float("inf")}, "offset is inf"),
    ],
)
def test_duhem_parameters(changes, message):
    with pytest.raises(ModelError, match=message):
        DuhemModel.gaussian(**(GAUSSIAN | changes))


def test_crossing_mixtures():
    with pytest.raises(ModelError, match="branches cross"):
        DuhemModel.mixture(
            heating=GaussianMixture((0.9, 0.1), (90, 60), (3, 3)),
            cooling=GaussianMixture((1.0,), (80,), (3,)),
            input_range=(20, 140),
        )


def test_mixture_weights():
    with pytest.raises(ModelError, match="sum 1"):
        GaussianMixture((0.9, 0.2), (90, 60), (3, 3))
    with pytest.raises(ModelError, match="one of each"):
        GaussianMixture((1.0,), (90, 60), (3, 3))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"a_heating": [-1]}, "heating rules: a has shape"),
        ({"b_cooling": [0, np.nan]}, "cooling rules: b"),
        ({"input_range": (0.5, 2)}, "centre 0 lies outside"),
        ({"a_heating": [200, 200]}, "expand"),
    ],
)
def test_rule_parameters(changes, message):
    with pytest.raises(ModelError, match=message):
        TSFuzzyDuhem(TriangularSets((0.0, 1.0)), **(LAWS | {"input_range": (0, 1)} | changes))


@pytest.mark.parametrize("centres", [(1.0,), (1.0, 1.0), (2.0, 1.0), (0.0, float("nan"))])
def test_set_centres(centres):
    for sets in (TriangularSets, lambda c: TrapezoidSets(c, 0.2), lambda c: GaussianSets(c, 1.0)):
        with pytest.raises(ModelError, match="fuzzy sets"):
            sets(centres)


@pytest.mark.parametrize(
    "sets", [TriangularSets((0.0, 1.0, 5.0)), TrapezoidSets((0.0, 1.0, 5.0), 0.4), GaussianSets((0.0, 1.0, 5.0), 0.8)]
)
def test_sets_are_a_partition_of_unity(sets):
    weights = sets.weights(np.linspace(-50, 50, 1001))
    np.testing.assert_allclose(weights.sum(axis=-1), 1.0, atol=1e-12)
    assert weights.min() >= 0
    assert weights[-1].argmax() == 2


def test_rules_say_what_they_are():
    model = MODELS["triangular"]
    assert len(model.rules) == 22
    rule = model.rules[5]
    assert str(rule).startswith("IF v is about 0 AND v rises THEN dw = (-0.0113")
    assert rule.time_law(2.0) == (2 * rule.a, 2 * rule.b)
    assert model.rules_text().count("IF") == 22
    assert len(model.rules_table().splitlines()) == 12


def test_certificates():
    assert PAPER.certificate().monotone
    for model in MODELS.values():
        certificate = model.certificate()
        assert certificate.holds
        assert certificate.invertible_share > 0.9
        assert certificate.forgetting_travel(np.exp(-1)) == pytest.approx(1 / certificate.contraction_rate)


def test_samples_must_be_finite(model):
    with pytest.raises(DataError, match="sample 1 is nan"):
        model.simulate([0.0, np.nan])
    with pytest.raises(DataError, match="expected numbers"):
        model.simulate(["cold", "hot"])
    with pytest.raises(DataError, match="at least one sample"):
        model.simulate([])
    with pytest.raises(DataError, match="3 values for 2 wires"):
        model.simulate(np.zeros((4, 2)), [1, 2, 3])
    with pytest.raises(DataError, match="must be finite"):
        model.initial_state(float("nan"))
    with pytest.raises(DataError, match="must be finite"):
        model.step(model.initial_state(0.0), float("nan"))
