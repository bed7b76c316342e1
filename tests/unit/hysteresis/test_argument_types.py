"""Models and fits from a script: arguments that are not numbers are errors that name the argument."""

import pytest

from smadrive.errors import DataError, IdentificationError, ModelError
from smadrive.hysteresis import DuhemModel, GaussianMixture, InverseFeedforward, TriangularSets, load_model, save_model
from smadrive.identification import identify_duhem, identify_tsfuzzy

GOOD = {"mu_heating": 90, "mu_cooling": 69, "sigma_heating": 5, "sigma_cooling": 5, "input_range": (20, 140)}
WIRE = DuhemModel.gaussian(**GOOD)
INPUT = [20, 80, 140, 80, 20]


def gaussian(**changed):
    return DuhemModel.gaussian(**{**GOOD, **changed})


@pytest.mark.parametrize(
    ("act", "kind", "where"),
    [
        (lambda: gaussian(mu_heating="90"), ModelError, "mixture: means"),
        (lambda: gaussian(scale="12"), ModelError, "scale"),
        (lambda: gaussian(offset=None), ModelError, "offset"),
        (lambda: gaussian(input_range=20), ModelError, "input_range"),
        (lambda: gaussian(input_range=(20, 140, 160)), ModelError, "input_range"),
        (lambda: gaussian(input_range=("20", "140")), ModelError, "input_range"),
        (lambda: GaussianMixture(1.0, (90.0,), (5.0,)), ModelError, "mixture: weights"),
        (lambda: TriangularSets(("a", "b")), ModelError, "sets: centre"),
        (lambda: TriangularSets(11), ModelError, "sets"),
        (lambda: WIRE.simulate(INPUT, "warm"), DataError, "initial output y0"),
        (lambda: WIRE.initial_state("20"), DataError, "initial state (v0, y)"),
        (lambda: InverseFeedforward(WIRE).trajectory([0.5], "20"), DataError, "initial state (v0, y)"),
        (lambda: identify_tsfuzzy(INPUT, WIRE.simulate(INPUT), sets="11"), IdentificationError, "sets"),
        (lambda: identify_tsfuzzy(INPUT, WIRE.simulate(INPUT), sets=-1), IdentificationError, "sets"),
        (lambda: identify_tsfuzzy(INPUT, WIRE.simulate(INPUT), sets=["a", "b"]), DataError, "sets"),
        (lambda: identify_tsfuzzy(INPUT, WIRE.simulate(INPUT), dead_band="1"), ModelError, "radius of the dead band"),
        (lambda: identify_duhem(INPUT, WIRE.simulate(INPUT), "2"), IdentificationError, "components"),
        (lambda: identify_duhem(INPUT, WIRE.simulate(INPUT), 1.5), IdentificationError, "components"),
        (lambda: load_model(3), ModelError, "path"),
        (lambda: save_model(WIRE, 3), ModelError, "path"),
    ],
)
def test_argument_of_another_type_is_named(act, kind, where):
    with pytest.raises(kind) as error:
        act()
    assert type(error.value) is kind
    assert error.value.where == where
    assert error.value.cure
