"""Fits of measured wires. The tests need a data folder beside the project, which is not part of the project."""

from pathlib import Path

import numpy as np
import pytest
from hold_out import hold_out

from smadrive.identification import identify_duhem, identify_tsfuzzy

DATA = Path(__file__).parents[4] / "shared" / "data"
RECORDS = (
    "flexinol_isobaric/100MPa",
    "flexinol_isobaric/172MPa",
    "nitihf_isobaric/100MPa",
    "nitihf_isobaric/300MPa",
    "nitico_isobaric/7MPa",
    "nitico_isobaric/150MPa",
)
CLIFFS = {  # worst half: errors at the hidden samples, % RMS, and the share of one of them in the square
    "flexinol_isobaric/100MPa": "fit 0.25, lines through neighbours 0.28, monotone cubics 0.26; 1 sample is 43 %",
    "nitihf_isobaric/100MPa": "fit 0.51, lines through neighbours 0.84, monotone cubics 0.70; 1 sample is 59 %",
    "nitico_isobaric/150MPa": "fit 0.37, lines through neighbours 0.83, monotone cubics 0.68; 1 sample is 23 %",
}
pytestmark = pytest.mark.skipif(not DATA.is_dir(), reason="the measured records lie beside the project")


def columns(name):
    table = np.loadtxt(DATA / f"{name}.csv", delimiter=",", skiprows=1)
    return table[:, 0], table[:, 1]


@pytest.mark.exhaustive
@pytest.mark.parametrize(
    ("name", "rms_percent", "max_percent"),
    [
        ("flexinol_isobaric/100MPa", 0.4, 3.5),
        ("flexinol_isobaric/172MPa", 0.4, 3.5),
        ("nitihf_isobaric/100MPa", 1.0, 10.0),
        ("nitihf_isobaric/300MPa", 1.0, 10.0),
    ],
)
def test_fit_with_twenty_two_rules_is_accurate(name, rms_percent, max_percent):
    fit = identify_tsfuzzy(*columns(name))
    assert len(fit.model.rules) == 22
    assert fit.rms_percent <= rms_percent
    assert fit.max_percent <= max_percent
    assert fit.certificate.holds
    if name.startswith("flexinol"):  # the others expand so much that their output does turn the other way
        assert fit.certificate.invertible_share >= 0.99


@pytest.fixture(scope="module", params=RECORDS)
def halves(request):
    return request.param, hold_out(*columns(request.param), identify_tsfuzzy)


@pytest.mark.exhaustive
def test_validation_error_is_near_the_training_error(halves, request):
    name, both = halves
    if name in CLIFFS:  # what lies between two samples there, neighbours do not tell
        request.applymarker(pytest.mark.xfail(reason=CLIFFS[name]))
    assert max(half.ratio for half in both) <= 1.2


@pytest.mark.exhaustive
def test_validation_error_is_that_of_training_or_below_that_of_neighbours(halves):
    _, both = halves
    assert all(half.ratio <= 1.2 or half.validation_percent < half.neighbours_percent for half in both)


@pytest.mark.exhaustive
@pytest.mark.parametrize("name", ["flexinol_isobaric/100MPa", "flexinol_isobaric/172MPa"])
def test_two_gaussians_beat_one(name):
    one, two = (identify_duhem(*columns(name), components=n) for n in (1, 2))
    assert two.rms_percent < 0.5 * one.rms_percent
