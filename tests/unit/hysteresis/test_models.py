"""Invalid parameters are rejected by name, value and cure; rules describe themselves."""

from math import nan

import numpy as np
import pytest

from smadrive.errors import DataError, ModelError
from smadrive.hysteresis import DuhemModel, GaussianMixture, GaussianSets, TrapezoidSets, TriangularSets, TSFuzzyDuhem

from .conftest import MODELS, PAPER

GAUSSIAN = {"mu_heating": 90, "mu_cooling": 70, "sigma_heating": 5, "sigma_cooling": 5, "input_range": (20, 140)}
LAWS = {"a_heating": [-1, -1], "b_heating": [0, 1], "a_cooling": [1, 1], "b_cooling": [0, -1]}


def test_printed_table_is_rejected_and_the_corrected_one_named():
    with pytest.raises(ModelError) as error:
        DuhemModel.gaussian(
            mu_heating=75, mu_cooling=70, sigma_heating=35, sigma_cooling=-45, scale=40, input_range=(-300, 300)
        )
    assert error.value.where == "Table 1"
    assert "DuhemModel.table1()" in error.value.cure


@pytest.mark.parametrize(
    ("changes", "where", "value"),
    [
        ({"sigma_cooling": -5}, "mixture (mu, sigma)", (70.0, -5.0)),
        ({"sigma_heating": float("nan")}, "mixture (mu, sigma)", None),
        ({"sigma_heating": 30}, "branches", 66.0),
        ({"mu_heating": 60}, "mu_heating", 60),
        ({"input_range": (140, 20)}, "input_range", (140, 20)),
        ({"input_range": (1000, 2000)}, "input_range", (1000, 2000)),
        ({"scale": 0}, "scale", 0),
        ({"offset": float("inf")}, "offset", float("inf")),
    ],
)
def test_wrong_duhem_parameter_is_rejected(changes, where, value):
    with pytest.raises(ModelError) as error:
        DuhemModel.gaussian(**(GAUSSIAN | changes))
    assert error.value.where == where
    assert value in (None, error.value.value)


def test_crossing_mixtures_are_rejected():
    with pytest.raises(ModelError) as error:
        DuhemModel.mixture(
            heating=GaussianMixture((0.9, 0.1), (90, 60), (3, 3)),
            cooling=GaussianMixture((1.0,), (80,), (3,)),
            input_range=(20, 140),
        )
    assert error.value.where == "branches"


@pytest.mark.parametrize("weights", [(0.9, 0.2), (1.0, 0.0), (nan, 0.5), (0.5, nan), (nan, nan)])
def test_wrong_mixture_weights_are_rejected(weights):
    with pytest.raises(ModelError) as error:
        GaussianMixture(weights, (90, 60), (3, 3))
    assert error.value.where == "mixture: weights"


def test_mixture_needs_a_weight_for_each_component():
    with pytest.raises(ModelError) as error:
        GaussianMixture((1.0,), (90, 60), (3, 3))
    assert error.value.value == (1, 2, 2)


@pytest.mark.parametrize("sequence", [list, np.array])
def test_mixture_of_any_sequence_is_that_of_tuples_and_makes_a_model(sequence):
    given = GaussianMixture(sequence([0.5, 0.5]), sequence([90, 100]), sequence([3, 3]))
    assert given == GaussianMixture((0.5, 0.5), (90.0, 100.0), (3.0, 3.0))
    cooling = GaussianMixture((1.0,), (70,), (3,))
    assert DuhemModel.mixture(heating=given, cooling=cooling, input_range=(20, 140)).heating == given


@pytest.mark.parametrize(
    ("changes", "where"),
    [
        ({"a_heating": [-1]}, "heating rules: a"),
        ({"b_cooling": [0, np.nan]}, "cooling rules: b"),
        ({"input_range": (0.5, 2)}, "set centre"),
        ({"a_heating": [200, 200]}, "rules"),
    ],
)
def test_wrong_rule_parameter_is_rejected(changes, where):
    with pytest.raises(ModelError) as error:
        TSFuzzyDuhem(TriangularSets((0.0, 1.0)), **(LAWS | {"input_range": (0, 1)} | changes))
    assert error.value.where == where


@pytest.mark.parametrize("centres", [(1.0,), (1.0, 1.0), (2.0, 1.0), (0.0, float("nan"))])
def test_wrong_set_centres_are_rejected(centres):
    for sets in (TriangularSets, lambda c: TrapezoidSets(c, 0.2), lambda c: GaussianSets(c, 1.0)):
        with pytest.raises(ModelError) as error:
            sets(centres)
        assert error.value.where.startswith("sets")


@pytest.mark.parametrize(
    "sets", [TriangularSets((0.0, 1.0, 5.0)), TrapezoidSets((0.0, 1.0, 5.0), 0.4), GaussianSets((0.0, 1.0, 5.0), 0.8)]
)
def test_sets_are_a_partition_of_unity(sets):
    weights = sets.weights(np.linspace(-50, 50, 1001))
    np.testing.assert_allclose(weights.sum(axis=-1), 1.0, atol=1e-12)
    assert weights.min() >= 0
    assert weights[-1].argmax() == 2


def test_rules_are_written_as_sentences():
    model = MODELS["triangular"]
    assert len(model.rules) == 22
    rule = model.rules[5]
    assert str(rule).startswith("IF v is about 0 AND v rises THEN dw = (-0.0113")
    assert model.rules_text().count("IF") == 22


def test_certificates():
    assert PAPER.certificate().invertible_share > 1 - 1e-9
    for model in MODELS.values():
        certificate = model.certificate()
        assert certificate.holds
        assert certificate.invertible_share > 0.9
        assert certificate.contraction_rate > 0


@pytest.mark.parametrize(
    ("action", "where"),
    [
        (lambda model: model.simulate([0.0, np.nan]), "input v: index 1"),
        (lambda model: model.simulate(["cold", "hot"]), "input v"),
        (lambda model: model.simulate([]), "input v"),
        (lambda model: model.simulate(np.zeros((4, 2)), [1, 2, 3]), "y0"),
        (lambda model: model.initial_state(float("nan")), "initial state (v0, y)"),
        (lambda model: model.step(model.initial_state(0.0), float("nan")), "input of the step"),
    ],
)
def test_unusable_samples_are_rejected(model, action, where):
    with pytest.raises(DataError) as error:
        action(model)
    assert error.value.where == where
