"""The displacement trim integrates the displacement error, but not while the wire crosses its hysteresis."""

import pytest

from smadrive.control.controllers.trim import FOLLOWS_C, MOST, SLOWER, DisplacementTrim


def test_lasting_error_is_corrected_within_the_integral_time():
    trim_mm = 0.0
    for _ in range(20):
        trim_mm = DisplacementTrim(0.25, 12.0, hysteretic=True).update(trim_mm, 0.1, 0.0, SLOWER * 0.25 / 20)
    assert trim_mm == pytest.approx(0.1)


@pytest.mark.parametrize("error_c", [FOLLOWS_C + 0.01, -10.0, float("inf")])
def test_trim_is_constant_while_the_wire_crosses_the_hysteresis(error_c):
    assert DisplacementTrim(0.25, 12.0, hysteretic=True).update(0.02, 0.5, error_c, 0.05) == 0.02


def test_one_missing_displacement_hardly_changes_the_trim_and_a_longer_loss_forgets_it():
    trim = DisplacementTrim(0.25, 12.0, hysteretic=True)
    assert trim.forgotten(0.02, 0.05) == pytest.approx(0.02, rel=0.05)
    assert trim.forgotten(0.02, 10.0 * SLOWER * 0.25) == pytest.approx(0.0, abs=1e-5)


@pytest.mark.parametrize(("hysteretic", "most_mm"), [(True, MOST * 12.0), (False, 12.0)])
def test_trim_is_limited(hysteretic, most_mm):
    trim_mm = 0.0
    for _ in range(1000):
        trim_mm = DisplacementTrim(0.25, 12.0, hysteretic=hysteretic).update(trim_mm, -0.5, 0.0, 0.05)
    assert trim_mm == -most_mm
