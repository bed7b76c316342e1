"""The caveats of a fit: a record that the model misses, a gap in the record, superfluous components."""

import re

import numpy as np
import pytest

from smadrive.hysteresis import DuhemModel
from smadrive.identification import identify_duhem, identify_tsfuzzy

WIRE = DuhemModel.gaussian(
    mu_heating=95, mu_cooling=75, sigma_heating=5, sigma_cooling=5.2, scale=-4.2, offset=5, input_range=(20, 140)
)
CORNERS = [25.0, 135.0, 30.0, 130.0, 60.0, 105.0, 40.0]
PATH = np.interp(np.arange(601) / 100, np.arange(len(CORNERS)), CORNERS)
OUTPUT = WIRE.simulate(PATH)


@pytest.fixture(scope="module")
def noisy():
    return OUTPUT + 0.01 * np.random.default_rng(3).standard_normal(len(PATH))


def test_good_record_gives_no_caveat(noisy):
    assert identify_tsfuzzy(PATH, noisy, sets=7).caveats == ()
    assert identify_duhem(PATH, noisy, components=1).caveats == ()


def test_gap_on_heating_gives_a_caveat_with_the_guessed_share(noisy):
    rising = np.diff(PATH, prepend=PATH[0]) > 0
    kept = ~(rising & (PATH > 84) & (PATH < 103))
    (caveat,) = identify_duhem(PATH[kept], noisy[kept], components=1).caveats
    (percent,) = re.findall(r"rising input .* (\d+) %", caveat)
    assert 90 <= int(percent) <= 99


def test_record_that_the_model_misses_gives_a_caveat_with_the_error():
    """The output of the wire is disturbed by a sine."""
    other = np.sin(np.arange(len(PATH)) / 13)
    fit = identify_duhem(PATH, OUTPUT + 0.6 * other, components=1)
    (caveat,) = fit.caveats
    assert f"{fit.rms_percent:.1f} %" in caveat


@pytest.mark.exhaustive
def test_superfluous_components_give_a_caveat(noisy):
    caveats = identify_duhem(PATH, noisy, components=3).caveats
    assert any("3 Gaussians of the heating branch" in caveat for caveat in caveats)
