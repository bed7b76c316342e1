"""The displacements that a wire can have at a temperature."""

from functools import cache
from itertools import pairwise
from math import inf, nan

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from smadrive.hysteresis import DuhemModel
from smadrive.safety.displacement_band import MARGIN, UNSURE_C, DisplacementBand


@cache
def wire(scale):
    return DuhemModel.gaussian(
        mu_heating=90, mu_cooling=69, sigma_heating=5, sigma_cooling=5, scale=scale, offset=1.0, input_range=(20, 140)
    )


@given(turns=st.lists(st.floats(20, 140), min_size=2, max_size=8), scale=st.sampled_from([12.0, -3.0]))
def test_wire_of_any_history_is_within_its_band(turns, scale):
    model = wire(scale)
    placed = DisplacementBand(model)
    v = np.concatenate([np.linspace(a, b, 30) for a, b in pairwise(turns)])
    aged = 1.0 + 0.9 * MARGIN
    for at_c, y in zip(v.tolist(), model.simulate(v).tolist(), strict=True):
        for off_c in (-0.9 * UNSURE_C, 0.9 * UNSURE_C):
            low, high = placed.band_mm(at_c + off_c)
            assert low <= 1.0 + aged * (y - 1.0) <= high
        for share in (1.0 / aged, aged):
            assert at_c + 0.9 * UNSURE_C <= placed.hottest_c(1.0 + share * (y - 1.0))
            least = placed.at_least(1.0 + share * (y - 1.0))
            assert least.temperature_c <= at_c - 0.9 * UNSURE_C
            assert least.phase <= (y - 1.0) / scale + 1e-9


@pytest.mark.parametrize("scale", [12.0, -3.0])
def test_cold_and_hot_wires_have_a_narrow_band(scale):
    placed = DisplacementBand(wire(scale))
    for at_c, y in ((22.0, 1.0), (130.0, 1.0 + scale)):
        low, high = placed.band_mm(at_c)
        assert low < y < high
        assert high - low < 2.5 * MARGIN * abs(scale)


def test_nearest_displacement_is_on_a_branch_or_between_them():
    placed = DisplacementBand(wire(12.0))
    assert placed.nearest_mm(22.0, 1.5) == pytest.approx(1.0, abs=1e-3)
    assert placed.nearest_mm(130.0, 1.5) == pytest.approx(13.0, abs=1e-3)
    assert placed.nearest_mm(80.0, 5.0) == 5.0


def test_band_is_constant_beyond_the_range_of_the_model():
    placed = DisplacementBand(wire(12.0))
    assert placed.band_mm(-50.0) == placed.band_mm(20.0 - UNSURE_C)
    assert placed.band_mm(500.0) == placed.band_mm(140.0 + UNSURE_C)


@pytest.mark.parametrize("scale", [12.0, -3.0])
def test_displacement_of_a_wire_that_is_not_transformed_limits_its_temperature(scale):
    placed = DisplacementBand(wire(scale))
    limits_c = [placed.hottest_c(1.0 + share * scale) for share in (0.0, 0.4, 0.8)]
    assert limits_c == pytest.approx([83.6 + UNSURE_C, 90.0 + UNSURE_C, 96.4 + UNSURE_C], abs=0.6)
    assert placed.hottest_c(1.0 + 0.95 * scale) == placed.hottest_c(nan) == inf


@pytest.mark.parametrize("scale", [12.0, -3.0])
def test_displacement_beyond_the_travel_is_impossible_at_every_temperature(scale):
    placed = DisplacementBand(wire(scale))
    reached = {share: placed.is_beyond_travel(1.0 + share * scale) for share in (-0.2, -0.09, 0.5, 1.09, 1.2)}
    assert reached == {-0.2: True, -0.09: False, 0.5: False, 1.09: False, 1.2: True}
    assert not placed.is_beyond_travel(nan)
