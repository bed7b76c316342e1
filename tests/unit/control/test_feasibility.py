"""Feasibility: a feasible reference passes; for any other the error gives the reason and the nearest feasible one."""

from dataclasses import replace

import numpy as np
import pytest
from marks import exhaustive

from smadrive.control.controllers.tracking_feedback import TrackingSettings
from smadrive.control.feasibility.feasibility import REASONS
from smadrive.control.feasibility.simulation import simulate_run
from smadrive.control.feedforward.displacement import HysteresisInverse
from smadrive.control.references.reference import CLOSED_MM, Reference
from smadrive.control.references.shapes import parse_reference
from smadrive.errors import ConfigError
from smadrive.hysteresis import DuhemModel
from smadrive.wire.heat_balance import HeatBalance
from smadrive.wire.wire_model import WireModel, WireState

LOOP = DuhemModel.gaussian(
    mu_heating=90, mu_cooling=69, sigma_heating=5, sigma_cooling=5, scale=12, input_range=(0, 160)
)
WIRE = WireModel(LOOP, HeatBalance(0.029, 0.012, 0.83, 22.0, 16.5, -0.12, 0.15))
SETTINGS = TrackingSettings(0.05, 0.6, closed_loop_s=0.25, integral_s=2.0, noise_c=0.1)


OPTION = "--smooth"


def simulated(spec, current_limit_a=0.6):
    reference = parse_reference(spec).with_approach(0.0, 10.0)
    settings = TrackingSettings(0.05, current_limit_a, closed_loop_s=0.25, integral_s=2.0, noise_c=0.1)
    start = WireState(22.0, LOOP.initial_state(22.0))
    return reference, simulate_run(reference, WIRE, HysteresisInverse(LOOP), settings, start)


def test_feasible_reference_passes_unchanged():
    reference, found = simulated("sine:low_mm=2.4,high_mm=9.6,period_s=56,cycles=1")
    assert found.feasible
    assert found.nearest is reference
    assert "feasible" in str(found)
    assert 90.0 < found.hottest_c < 110.0
    found.check(temperature_max_c=135.0, smooth=False, smooth_option=OPTION)


def test_fall_faster_than_cooling_is_rejected_with_reason_and_cure():
    _, found = simulated("trapezoid:low_mm=2.4,high_mm=9.6,rise_s=1.5,dwell_s=8,cycles=1")
    assert not found.feasible
    assert found.limit == "cooling"
    assert found.setpoint_mm_per_s < found.reached_mm_per_s < 0.0
    with pytest.raises(ConfigError) as error:
        found.check(temperature_max_c=135.0, smooth=False, smooth_option=OPTION)
    assert error.value.where == "reference"
    assert REASONS["cooling"] in error.value.what
    assert f"{found.slower:.1f} times" in error.value.cure
    assert "--smooth" in error.value.cure
    found.check(temperature_max_c=135.0, smooth=True, smooth_option=OPTION)
    with pytest.raises(ConfigError) as error:
        found.check(temperature_max_c=90.0, smooth=True, smooth_option=OPTION)
    assert error.value.limit == "90 °C"


@pytest.mark.exhaustive
def test_jump_is_not_cured_by_slowing_it_down():
    _, found = simulated("steps:low_mm=3,high_mm=8,dwell_s=50")
    with pytest.raises(ConfigError) as error:
        found.check(temperature_max_c=135.0, smooth=False, smooth_option=OPTION)
    assert "times" not in error.value.cure
    assert "--smooth" in error.value.cure


def test_slowing_down_as_suggested_halves_the_shortfall():
    _, found = simulated("trapezoid:low_mm=2.4,high_mm=9.6,rise_s=1.5,dwell_s=8,cycles=1")
    _, slower = simulated(f"trapezoid:low_mm=2.4,high_mm=9.6,rise_s={1.3 * found.slower * 1.5},dwell_s=8,cycles=1")
    assert slower.shortfall_mm < 0.5 * found.shortfall_mm


def test_weak_heater_is_the_limit_of_a_fast_rise():
    _, found = simulated("trapezoid:low_mm=2.4,high_mm=9.6,rise_s=2,dwell_s=10,cycles=0.5", current_limit_a=0.29)
    assert found.limit == "heater"
    assert REASONS["heater"] in str(found)


def test_nearest_reference_of_steps_has_feasible_ramps():
    jumps, found = simulated("steps:low_mm=2.4,high_mm=9.6,dwell_s=12,cycles=1")
    smooth = found.nearest
    assert not found.feasible
    assert smooth.scored_from_s == jumps.scored_from_s
    assert smooth.value_mm(33.9) == pytest.approx(9.6, abs=0.05)
    rates = np.diff(smooth.displacement_mm) / np.diff(smooth.times_s)
    assert -12.0 < rates.min() < -1.0
    start = WireState(22.0, LOOP.initial_state(22.0))
    again = simulate_run(smooth, WIRE, HysteresisInverse(LOOP), SETTINGS, start)
    assert again.shortfall_mm < 0.1 * found.shortfall_mm


def test_run_above_the_temperature_limit_is_rejected():
    _, found = simulated("sine:low_mm=2.4,high_mm=9.6,period_s=56,cycles=1")
    with pytest.raises(ConfigError) as error:
        found.check(temperature_max_c=90.0, smooth=False, smooth_option=OPTION)
    assert error.value.value == f"{found.hottest_c:.0f} °C"
    assert error.value.limit == "90 °C"


@pytest.mark.parametrize(
    ("spec", "caveats"),
    [
        ("sine:low_mm=0.002,high_mm=0.009,period_s=20,cycles=1", 1),  # metres
        ("sine:low_mm=2,high_mm=2.003,period_s=20,cycles=1", 1),
        ("sine:low_mm=2,high_mm=2.2,period_s=20,cycles=1", 0),
        ("trapezoid:low_mm=5,high_mm=5,rise_s=5,cycles=1", 0),  # to hold is meant
    ],
)
def test_reference_within_the_noise_of_the_sensor_gives_a_caveat(spec, caveats):
    _, found = simulated(spec)
    assert len(found.caveats) == caveats
    assert all("is it in mm?" in caveat and "of a stroke of 12 mm" in caveat for caveat in found.caveats)


@pytest.mark.parametrize(
    ("spec", "hot_start_mm"),
    [
        ("triangle:low_mm=6,high_mm=3,period_s=80,cycles=1", 6.0),
        ("triangle:low_mm=3,high_mm=6,period_s=80,cycles=1", None),
        ("trapezoid:low_mm=5,high_mm=5,rise_s=5,cycles=1", None),
    ],
)
def test_reference_that_begins_at_its_hot_end_gives_a_caveat(spec, hot_start_mm):
    _, found = simulated(spec)
    assert found.hot_start_mm == hot_start_mm
    assert len(found.caveats) == (hot_start_mm is not None) + (not found.feasible)


def test_reference_with_times_in_milliseconds_gives_a_caveat():
    _, found = simulated("triangle:low_mm=3,high_mm=6,period_s=80,cycles=1")
    assert (found.scored_s, found.speed_mm_per_s) == (80.0, pytest.approx(6.0 / 80.0))
    slow = replace(found, scored_s=1e3 * found.scored_s, speed_mm_per_s=1e-3 * found.speed_mm_per_s)
    assert len(slow.caveats) == len(found.caveats) + 1


def test_wire_that_is_still_hot_before_the_reference_should_cool_first():
    reference = parse_reference("triangle:low_mm=1,high_mm=6,period_s=80,cycles=1").with_approach(11.0, 2.0)
    found = simulate_run(
        reference, WIRE, HysteresisInverse(LOOP), SETTINGS, WireState(120.0, LOOP.initial_state(120.0))
    )
    assert (found.in_approach, found.limit) == (True, "cooling")
    with pytest.raises(ConfigError) as error:
        found.check(temperature_max_c=135.0, smooth=False, smooth_option=OPTION)
    assert "cool" in error.value.cure
    assert "slow" not in error.value.cure


THICK = WireModel(LOOP, replace(WIRE.balance, heat_capacity_j_per_k=4 * 0.029, latent_heat_j=4 * 0.83))
"""A wire that cools more slowly than the way back of a repeated reference."""

STEPS = Reference.from_samples([0.0, 10.0, 10.1, 20.0, 20.1, 30.0], [2.0, 2.0, 8.0, 8.0, 2.0, 2.0])


def repeated(reference, wire, *, smoothed=False):
    """Simulate five cycles of a reference from the cold wire; `smoothed`: of its nearest reference."""
    start = WireState(22.0, LOOP.initial_state(22.0))
    given = reference.with_approach(0.0, 10.0).repeated(5, 10.0)
    found = simulate_run(given, wire, HysteresisInverse(LOOP), SETTINGS, start)
    if not smoothed:
        return given, found
    return given, simulate_run(found.nearest, wire, HysteresisInverse(LOOP), SETTINGS, start)


def test_way_back_that_the_wire_cannot_follow_is_not_cured_by_slowing_the_reference_down():
    ramp = Reference.from_samples([0.0, 60.0], [1.0, 10.0])
    given, found = repeated(ramp, THICK)
    assert (found.feasible, found.limit) == (False, "cooling")
    with pytest.raises(ConfigError) as error:
        found.check(135.0, smooth=False, smooth_option=OPTION, way_back_s=given.cycle_s - ramp.cycle_s)
    assert "10 s" in error.value.cure
    assert "times" not in error.value.cure


@pytest.mark.parametrize(
    ("reference", "wire"), [exhaustive(Reference.from_samples([0.0, 60.0], [1.0, 10.0]), THICK), (STEPS, WIRE)]
)
def test_smoothed_cycles_are_as_long_as_the_given_ones_and_feasible(reference, wire):
    given, found = repeated(reference, wire)
    assert not found.feasible
    nearest = found.nearest
    assert (nearest.repeats, nearest.cycle_s) == (5, pytest.approx(given.cycle_s))
    assert nearest.value_mm(nearest.scored_from_s) == pytest.approx(nearest.displacement_mm[-1], abs=CLOSED_MM)
    _, again = repeated(reference, wire, smoothed=True)
    assert again.shortfall_mm < 0.025 * again.stroke_mm
    again.check_smoothed()


def test_cycles_that_are_too_fast_also_when_smoothed_are_rejected():
    fast = parse_reference("trapezoid:low_mm=1,high_mm=10,rise_s=2,dwell_s=3,cycles=1")
    _, again = repeated(fast, THICK, smoothed=True)
    with pytest.raises(ConfigError) as error:
        again.check_smoothed()
    assert error.value.where == "reference"
