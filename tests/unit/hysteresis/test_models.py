"""First checks of the contract: both models simulate, step, invert and survive their file."""

import numpy as np
import pytest

from smadrive.errors import CertificateError, DataError, ModelError
from smadrive.hysteresis import (
    DuhemModel,
    InverseFeedforward,
    TriangularSets,
    TSFuzzyDuhem,
    load_model,
    save_model,
)

TURNS = np.array([-300.0, 180.0, -90.0, 60.0, -20.0, 250.0, -260.0])
PATH = np.concatenate([np.linspace(a, b, 50, endpoint=False) for a, b in zip(TURNS[:-1], TURNS[1:], strict=True)])


@pytest.fixture(params=["duhem", "tsfuzzy"], scope="module")
def model(request):
    duhem = DuhemModel.table1()
    if request.param == "duhem":
        return duhem
    return TSFuzzyDuhem.from_duhem(duhem, TriangularSets(tuple(np.linspace(-300, 300, 11))))


def test_stepping_agrees_with_simulation(model):
    state, outputs = model.initial_state(PATH[0]), []
    for v in PATH:
        state = model.step(state, v)
        outputs.append(state.y)
    np.testing.assert_allclose(outputs, model.simulate(PATH), atol=1e-12 * abs(model.scale))


def test_inverse_reaches_what_it_says(model):
    wanted = 20 + 15 * np.sin(np.linspace(0, 20, 300))
    result = InverseFeedforward(model).trajectory(wanted, -300.0)
    assert result.reachable.all()
    start = model.initial_state(-300.0)
    reached = model.simulate(np.concatenate([[-300.0], result.v]), start.y)[1:]
    np.testing.assert_allclose(reached, wanted, atol=1e-8 * model.scale)


def test_unreachable_saturates(model):
    result = InverseFeedforward(model).trajectory([20.0, 50.0, -10.0], -300.0)
    assert result.reachable.tolist() == [True, False, False]
    assert result.v[1] == 300.0
    assert result.v[2] == -300.0


def test_model_file_round_trip(model, tmp_path):
    save_model(model, tmp_path / "model.json", provenance={"source": "test"})
    again = load_model(tmp_path / "model.json")
    np.testing.assert_array_equal(again.simulate(PATH), model.simulate(PATH))


def test_far_outside_the_range_the_state_is_held(model):
    y = model.simulate([-300.0, 1e6, -1e6, 1e6, 0.0])
    assert np.isfinite(y).all()
    assert y[1] == model.simulate([-300.0, 300.0])[1]


def test_printed_table_is_refused():
    with pytest.raises(ModelError, match="Table 1"):
        DuhemModel.gaussian(mu_heating=75, mu_cooling=70, sigma_heating=35, sigma_cooling=-45, scale=40, input_range=(-300, 300))


def test_uncertified_file_is_refused(tmp_path):
    model = TSFuzzyDuhem(
        TriangularSets((0.0, 1.0)), a_heating=[1, 1], b_heating=[0, 0], a_cooling=[1, 1], b_cooling=[0, 0], input_range=(0, 1)
    )
    save_model(model, tmp_path / "model.json")
    with pytest.raises(CertificateError, match="model.json"):
        load_model(tmp_path / "model.json")
    assert load_model(tmp_path / "model.json", allow_uncertified=True).simulate([0.0, 1.0], 0.5)[1] == pytest.approx(0.5 * np.e)


def test_nan_is_refused(model):
    with pytest.raises(DataError, match="sample 1 is nan"):
        model.simulate([0.0, np.nan])
