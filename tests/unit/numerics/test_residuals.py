"""The noise of a record is found although its sensor is slow or coarse, and makes no false reversal."""

import numpy as np
import pytest

from smadrive.hysteresis.reversal import turning_points
from smadrive.numerics.residuals import noise_deviation

BANDS = 4.0
RAMP = 40.0 + 60.0 * np.abs((np.arange(8000) / 1000.0 + 1.0) % 2.0 - 1.0)
"""Eight ramps, with steps of 0.06."""


def read(noise, slower=1, quantum=0.0):
    """The readings of a sensor with white noise, which gives a new value every `slower` samples, in whole quanta."""
    values = RAMP + noise * np.random.default_rng(1).normal(size=RAMP.size)
    held = np.repeat(values[::slower], slower)[: RAMP.size]
    return quantum * np.round(held / quantum) if quantum else held


@pytest.mark.parametrize("order", [2, 3])
@pytest.mark.parametrize("slower", [1, 2, 3, 4, 7])
def test_noise_of_a_slow_sensor_is_found(slower, order):
    assert noise_deviation(read(0.1, slower), order) == pytest.approx(0.1, rel=0.2)


@pytest.mark.parametrize("slower", [1, 2, 4])
@pytest.mark.parametrize("quantum", [0.1, 0.5, 1.0])
@pytest.mark.parametrize("noise", [0.0, 0.02, 0.1])
def test_coarse_or_slow_sensor_makes_no_false_reversal(noise, quantum, slower):
    readings = read(noise, slower, quantum)
    found = noise_deviation(readings)
    assert found <= max(1.3 * quantum, 2.0 * noise)
    assert len(turning_points(readings, BANDS * found)) == len(turning_points(RAMP, 1.0))


@pytest.mark.parametrize("quantum", [0.5, 1.0])
def test_noise_is_at_least_that_of_the_rounding(quantum):
    assert noise_deviation(read(0.0, quantum=quantum)) >= quantum / np.sqrt(12.0)


@pytest.mark.parametrize("samples", [[], [1.0], [2.0] * 9, [1.0, 1.0, 2.0]])
def test_record_without_enough_values_has_no_noise(samples):
    assert noise_deviation(np.array(samples)) == 0.0


def test_step_of_a_computed_record_is_no_quantum():
    computed = np.repeat([0.0, 1e-310, 1.0, 3.0, 6.0, 10.0], 3)
    assert noise_deviation(computed) == pytest.approx(1.0 / 0.6745 / np.sqrt(6.0), rel=1e-3)


def test_exact_record_has_no_noise():
    assert noise_deviation(RAMP) < 1e-9
