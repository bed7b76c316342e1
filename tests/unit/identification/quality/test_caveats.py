"""What a fit says against itself: a record missed, a gap bridged, components that are not there."""

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


def test_a_good_record_leaves_nothing_to_say(noisy):
    assert identify_tsfuzzy(PATH, noisy, sets=7).caveats == ()
    assert identify_duhem(PATH, noisy, components=1).caveats == ()


def test_a_gap_is_told_with_what_is_guessed_in_it(noisy):
    rising = np.diff(PATH, prepend=PATH[0]) > 0
    kept = ~(rising & (PATH > 84) & (PATH < 103))
    (caveat,) = identify_duhem(PATH[kept], noisy[kept], components=1).caveats
    assert "of rising input it moves by 9" in caveat
    assert "record that stretch" in caveat


def test_a_record_that_is_missed_is_told():
    """Another output laid over the wire's."""
    other = np.sin(np.arange(len(PATH)) / 13)
    (caveat,) = identify_duhem(PATH, OUTPUT + 0.6 * other, components=1).caveats
    assert "misses its own record by" in caveat


def test_components_that_are_not_there_are_told(noisy):
    caveats = identify_duhem(PATH, noisy, components=3).caveats
    assert any("does not tell the 3 Gaussians of its heating branch apart" in caveat for caveat in caveats)
