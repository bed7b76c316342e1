"""The reading of an unheated wire is compared with the ambient temperature of the wire file."""

from math import nan

import pytest

from smadrive.wire.cold_wire import COLD_WIRE_K, calibration_caveats, cold_wire_caveats, is_too_cold, limit_caveats

AMBIENT_C = 22.0


@pytest.mark.parametrize(("difference_k", "is_doubted"), [(-19.8, True), (-9.9, False), (9.9, False), (10.1, True)])
def test_reading_far_from_ambient_is_a_caveat(difference_k, is_doubted):
    temperature_c = AMBIENT_C + difference_k
    for caveats in (cold_wire_caveats(temperature_c, AMBIENT_C), calibration_caveats(temperature_c, AMBIENT_C)):
        assert len(caveats) == is_doubted
        assert all(f"{temperature_c:.1f} °C" in text and f"{COLD_WIRE_K:g} K" in text for text in caveats)
    assert is_too_cold(temperature_c, AMBIENT_C) is (difference_k < -COLD_WIRE_K)


def test_invalid_reading_is_no_caveat():
    assert cold_wire_caveats(nan, AMBIENT_C) == ()
    assert not is_too_cold(nan, AMBIENT_C)


@pytest.mark.parametrize(
    ("offset_c", "scale", "is_doubted"),
    [(0.0, 0.8, True), (-9.0, 0.98, True), (0.0, 0.95, False), (0.0, 1.25, False), (-20.0, 1.0, False)],
    ids=["too low", "low everywhere", "slightly low", "high", "wrong at ambient, too"],
)
def test_calibration_that_is_right_at_ambient_but_lowers_the_limit_is_a_caveat(offset_c, scale, is_doubted):
    assert len(limit_caveats(lambda reading_c: scale * reading_c + offset_c, AMBIENT_C, 130.0)) == is_doubted
