"""The noise of a thermocouple is found in its readings, whatever the wire does."""

import numpy as np
import pytest

from smadrive.runs.metrics.thermocouple_noise import LEAST_SAMPLES, measured_noise_c, noise_caveats

TIME_S = np.arange(0.0, 60.0, 0.05)
ZIGZAG_C = 70.0 + 40.0 * np.abs((TIME_S / 10.0) % 2.0 - 1.0)


@pytest.mark.parametrize("noise_c", [0.05, 0.4])
@pytest.mark.parametrize("repeated", [1, 4])
def test_noise_of_a_moving_wire_with_spikes_gaps_and_a_slow_thermometer(noise_c, repeated):
    reading_c = ZIGZAG_C + np.random.default_rng(1).normal(0.0, noise_c, TIME_S.size)
    reading_c[::50] += 30.0
    reading_c[7::90] = np.nan
    slow_c = np.repeat(reading_c[::repeated], repeated)
    assert measured_noise_c(slow_c) == pytest.approx(noise_c, rel=0.25)


def test_noise_of_few_samples_is_unknown():
    assert np.isnan(measured_noise_c(ZIGZAG_C[: LEAST_SAMPLES - 1]))


@pytest.mark.parametrize(("assumed_c", "caveats"), [(0.1, 1), (0.25, 0)])
def test_noise_above_twice_the_assumed_one_is_a_caveat(assumed_c, caveats):
    reading_c = ZIGZAG_C + np.random.default_rng(1).normal(0.0, 0.4, TIME_S.size)
    assert len(noise_caveats(reading_c, assumed_c)) == caveats
