"""Moving the branches of a model: exact for a Duhem model, close and certified for rules."""

from itertools import pairwise

import numpy as np
import pytest

from smadrive.errors import ModelError
from smadrive.hysteresis import DuhemModel, TriangularSets, TSFuzzyDuhem
from smadrive.identification import identify_tsfuzzy
from smadrive.identification.reshape import BranchShape, reshaped, shape_of

SHAPE = BranchShape(mu_heating=90.0, mu_cooling=69.0, sigma_heating=5.0, sigma_cooling=5.0, scale=12.0)
TURNS = [20, 130, 20, 95, 75, 105, 60, 90, 20]
PATH = np.concatenate([np.linspace(a, b, 100) for a, b in pairwise(TURNS)])
MOVES = [
    {},
    {"mu_heating": 92.0, "mu_cooling": 71.0},
    {"mu_heating": 92.0, "mu_cooling": 67.0},
    {"mu_cooling": 67.0},
    {"sigma_heating": 6.0, "sigma_cooling": 6.0},
    {"scale": 11.0},
]


def duhem(shape):
    return DuhemModel.gaussian(**shape._asdict(), input_range=(20, 140))


@pytest.fixture(scope="module")
def rules():
    return identify_tsfuzzy(PATH, duhem(SHAPE).simulate(PATH), sets=11).model


@pytest.fixture(scope="module")
def few_rules():
    """Rules for the tests that need no accuracy."""
    return identify_tsfuzzy(PATH[::5], duhem(SHAPE).simulate(PATH[::5]), sets=6, fit_centres=False).model


def test_shape_is_that_of_the_gaussians():
    assert shape_of(duhem(SHAPE)) == pytest.approx(SHAPE, abs=0.02)


@pytest.mark.parametrize("move", MOVES)
def test_duhem_model_moves_exactly(move):
    moved = reshaped(duhem(SHAPE), SHAPE._replace(**move))
    assert moved.simulate(PATH) == pytest.approx(duhem(SHAPE._replace(**move)).simulate(PATH), abs=0.02)


@pytest.mark.exhaustive
@pytest.mark.parametrize("move", MOVES)
def test_rules_move_closely_and_stay_certified(rules, move):
    """The scale of the rules is compared by its change: it includes what lies beyond the record, which is a guess."""
    own, aim = shape_of(rules), SHAPE._replace(**move)
    shape = own._replace(**move)._replace(scale=own.scale * aim.scale / SHAPE.scale)
    moved = reshaped(rules, shape)
    error = moved.simulate(PATH) - duhem(aim).simulate(PATH)
    assert shape_of(moved) == pytest.approx(shape, abs=0.1)
    assert np.sqrt(np.mean(error**2)) < 0.012 * SHAPE.scale
    assert moved.certificate().holds
    assert moved.certificate().invertible_share > 0.999


@pytest.mark.exhaustive
def test_moving_back_gives_the_same_rules(rules):
    shape = shape_of(rules)
    same = reshaped(rules, shape)
    assert isinstance(same, TSFuzzyDuhem)
    assert same.heating_law[0] == pytest.approx(rules.heating_law[0], rel=1e-6, abs=1e-9)


def test_sets_that_leave_the_range_stay_apart():
    model = DuhemModel.gaussian(
        mu_heating=90.0, mu_cooling=69.0, sigma_heating=5.0, sigma_cooling=5.0, scale=12.0, input_range=(20.0, 130.0)
    )
    even = TSFuzzyDuhem.from_duhem(model, TriangularSets(tuple(np.linspace(20.0, 130.0, 11).tolist())))
    shape = shape_of(even)
    moved = reshaped(even, shape._replace(mu_heating=shape.mu_heating + 11.0, mu_cooling=shape.mu_cooling + 11.0))
    assert shape_of(moved).mu_heating == pytest.approx(shape.mu_heating + 11.0, abs=0.5)


def test_falling_output_keeps_its_sign(few_rules):
    falling = TSFuzzyDuhem(
        TriangularSets(few_rules.sets.centres),
        a_heating=few_rules.heating_law[0],
        b_heating=few_rules.heating_law[1],
        a_cooling=few_rules.cooling_law[0],
        b_cooling=few_rules.cooling_law[1],
        scale=-12.0,
        offset=12.0,
        input_range=few_rules.input_range,
    )
    assert reshaped(falling, shape_of(falling)._replace(scale=-10.0)).scale == -10.0
    with pytest.raises(ModelError) as error:
        reshaped(falling, shape_of(falling)._replace(scale=10.0))
    assert (error.value.where, error.value.value, error.value.limit) == ("scale", "10, of the model -12", None)


@pytest.mark.parametrize(
    "move",
    [
        {"mu_heating": 68.0},
        {"mu_heating": 400.0},
        {"sigma_cooling": -1.0},
        {"scale": 0.0},
        {"scale": float("nan")},
        {"mu_cooling": float("nan")},
    ],
)
@pytest.mark.parametrize("kind", ["duhem", "rules"])
def test_impossible_shape_is_rejected_by_name(few_rules, kind, move):
    model = few_rules if kind == "rules" else duhem(SHAPE)
    with pytest.raises(ModelError) as error:
        reshaped(model, shape_of(model)._replace(**move))
    assert [error.value.where] == list(move)


def test_rules_without_a_branch_cannot_be_moved(few_rules):
    (a_heating, _), (a_cooling, b_cooling) = few_rules.heating_law, few_rules.cooling_law
    never_rises = TSFuzzyDuhem(
        few_rules.sets,
        a_heating=a_heating,
        b_heating=np.zeros_like(a_heating),
        a_cooling=a_cooling,
        b_cooling=b_cooling,
        scale=few_rules.scale,
        input_range=few_rules.input_range,
    )
    assert shape_of(never_rises).sigma_heating == 0.0
    with pytest.raises(ModelError) as error:
        reshaped(never_rises, SHAPE)
    assert error.value.where == "rules"
