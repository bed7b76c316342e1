"""Models shared by the hysteresis tests: the paper's, a measured wire's, and their T-S fuzzy counterparts."""

import numpy as np
import pytest

from smadrive.hysteresis import DuhemModel, GaussianMixture, GaussianSets, TrapezoidSets, TriangularSets, TSFuzzyDuhem

WIRE = DuhemModel.mixture(
    heating=GaussianMixture((0.6, 0.4), (91.0, 98.0), (3.0, 5.0)),
    cooling=GaussianMixture((0.5, 0.5), (70.0, 77.0), (3.5, 4.5)),
    scale=-4.2,
    offset=4.5,
    input_range=(25.0, 140.0),
)
PAPER = DuhemModel.table1()
EVEN = tuple(np.linspace(-300.0, 300.0, 11))
MODELS = {
    "paper": PAPER,
    "wire": WIRE,
    "triangular": TSFuzzyDuhem.from_duhem(PAPER, TriangularSets(EVEN)),
    "trapezoid": TSFuzzyDuhem.from_duhem(PAPER, TrapezoidSets(EVEN, 0.3)),
    "gaussian": TSFuzzyDuhem.from_duhem(PAPER, GaussianSets(EVEN, 40.0)),
    "wire-tsfuzzy": TSFuzzyDuhem.from_duhem(WIRE, TriangularSets(tuple(np.linspace(40.0, 125.0, 15)))),
}


@pytest.fixture(params=MODELS)
def model(request):
    return MODELS[request.param]


@pytest.fixture
def turns(model):
    """Random turning points over the range, the same for every run."""
    lower, upper = model.input_range
    return np.concatenate([[lower], np.random.default_rng(4).uniform(lower, upper, 16)])
