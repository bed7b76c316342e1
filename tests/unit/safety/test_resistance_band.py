"""The resistance at rest of a run: sound wires stay within the band, and a jump leaves it."""

from itertools import pairwise
from math import nan

import numpy as np
import pytest

from smadrive.hysteresis import DuhemModel
from smadrive.measurement import Measurement
from smadrive.safety.displacement_band import DisplacementBand
from smadrive.safety.resistance_band import BLOCK_S, FOLLOW_S, ResistanceBand
from smadrive.wire.health.expected_rest import ExpectedRest
from smadrive.wire.heat_balance import HeatBalance
from smadrive.wire.wire_model import WireModel

MODEL = DuhemModel.gaussian(
    mu_heating=90, mu_cooling=69, sigma_heating=5, sigma_cooling=5, scale=12.0, input_range=(20, 140)
)
WIRE = WireModel(MODEL, HeatBalance(0.03, 0.014, 0.8, 22.0, 16.5, -0.12, 0.15))
PERIOD_S = 0.05
TURNS_C = (25, 110, 40, 100, 50, 95, 25)


def band(tolerance=0.03, ohm=16.5):
    return ResistanceBand(WIRE, DisplacementBand(MODEL), ExpectedRest(ohm, tolerance), 0.6)


def path():
    return np.concatenate([np.linspace(a, b, 400) for a, b in pairwise(TURNS_C)])


def run(checked, series_ohm, *, sensor=True, current_a=0.25):
    """Drive the wire through its loop, with `series_ohm(time_s)` in series. Return the time of the jump, or None."""
    wire_c = path()
    for number, (at_c, y) in enumerate(zip(wire_c.tolist(), MODEL.simulate(wire_c).tolist(), strict=True)):
        time_s = PERIOD_S * number
        loop_ohm = 16.5 * (1.0 - 0.12 * y / 12.0) + series_ohm(time_s)
        values = {"current_a": current_a, "voltage_v": current_a * loop_ohm}
        measured = Measurement(time_s, temperature_c=at_c, displacement_mm=y if sensor else nan, **values)
        if checked.jumped(measured) is not None:
            return time_s
    return None


@pytest.mark.parametrize("sensor", [True, False])
def test_sound_wire_stays_within_its_band(sensor):
    assert run(band(), lambda _time_s: 0.0, sensor=sensor) is None


@pytest.mark.parametrize("series_ohm", [1.0, 3.0])
def test_cracked_crimp_is_found_within_eight_seconds(series_ohm):
    found_s = run(band(), lambda time_s: series_ohm * (time_s > 30.0))
    assert 30.0 < found_s < 30.0 + 4.0 * BLOCK_S + 1.0


def test_cracked_crimp_is_found_without_a_sensor():
    assert run(band(), lambda time_s: 2.0 * (time_s > 30.0), sensor=False) > 30.0


def test_other_wire_is_found_from_the_start():
    assert run(band(ohm=15.0), lambda _time_s: 0.0) < 4.0 * BLOCK_S + 1.0


def test_short_disturbance_is_no_jump():
    assert run(band(), lambda time_s: 5.0 * (30.0 < time_s < 30.0 + 1.5 * BLOCK_S)) is None


def test_slow_drift_of_a_long_run_is_no_jump():
    """5 % within two hours: more than the tolerance in all, but little within the time constant of the band."""
    checked = band()
    for number in range(int(7200.0 / 0.5)):
        time_s = 0.5 * number
        voltage_v = 0.25 * 16.5 * (1.0 + 0.05 * time_s / 7200.0)
        measured = Measurement(time_s, temperature_c=25.0, displacement_mm=0.0, current_a=0.25, voltage_v=voltage_v)
        assert checked.jumped(measured) is None
    assert FOLLOW_S < 7200.0


@pytest.mark.parametrize("values", [{"current_a": 0.01}, {"voltage_v": nan}, {"temperature_c": nan}])
def test_unusable_samples_are_left_out(values):
    checked = band()
    for number in range(400):
        sample = {"temperature_c": 25.0, "current_a": 0.3, "voltage_v": 9.0} | values
        assert checked.jumped(Measurement(PERIOD_S * number, displacement_mm=nan, **sample)) is None
