"""The rehearsal: lets pass what the wire can do, and says of the rest why not, and what it could do instead."""

import numpy as np
import pytest

from smadrive.control.controllers.tracking import TrackingSettings
from smadrive.control.feasibility import simulate_run
from smadrive.control.feedforward.displacement import HysteresisInverse
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


def rehearsed(spec, current_limit_a=0.6):
    reference = parse_reference(spec).with_approach(0.0, 10.0)
    settings = TrackingSettings(0.05, current_limit_a, closed_loop_s=0.25, integral_s=2.0, noise_c=0.1)
    start = WireState(22.0, LOOP.initial_state(22.0))
    return reference, simulate_run(reference, WIRE, HysteresisInverse(LOOP), settings, start)


def test_what_the_wire_can_do_passes_unchanged():
    reference, found = rehearsed("sine:low_mm=2.4,high_mm=9.6,period_s=56,cycles=1")
    assert found.feasible
    assert found.nearest is reference
    assert "feasible" in str(found)
    assert 90.0 < found.hottest_c < 110.0
    found.check(temperature_max_c=135.0)


def test_a_fall_faster_than_cooling_is_refused_with_the_rates_and_the_cure():
    _, found = rehearsed("trapezoid:low_mm=2.4,high_mm=9.6,rise_s=1.5,dwell_s=8,cycles=1")
    assert not found.feasible
    assert found.limit == "cooling"
    assert found.setpoint_mm_per_s < found.reached_mm_per_s < 0.0
    with pytest.raises(
        ConfigError, match=r"wanted are -.* mm/s.*no current.*slow it down about [\d.]+ times.*--smooth"
    ):
        found.check(temperature_max_c=135.0)
    found.check(temperature_max_c=135.0, smooth=True)
    with pytest.raises(ConfigError, match="temperature_max_c = 90"):
        found.check(temperature_max_c=90.0, smooth=True)


def test_a_jump_is_not_cured_by_slowing_it_down():
    _, found = rehearsed("steps:low_mm=3,high_mm=8,dwell_s=50")
    with pytest.raises(ConfigError, match=r"no faster: run the nearest that the wire can follow \(--smooth\)"):
        found.check(temperature_max_c=135.0)


def test_slowed_down_as_told_it_passes_or_nearly():
    _, found = rehearsed("trapezoid:low_mm=2.4,high_mm=9.6,rise_s=1.5,dwell_s=8,cycles=1")
    _, slower = rehearsed(f"trapezoid:low_mm=2.4,high_mm=9.6,rise_s={1.3 * found.slower * 1.5},dwell_s=8,cycles=1")
    assert slower.shortfall_mm < 0.5 * found.shortfall_mm


def test_a_weak_heater_is_named():
    _, found = rehearsed("trapezoid:low_mm=2.4,high_mm=9.6,rise_s=2,dwell_s=10,cycles=0.5", current_limit_a=0.29)
    assert found.limit == "heater"
    assert "largest current" in str(found)


def test_steps_become_the_ramps_that_the_wire_can_do():
    jumps, found = rehearsed("steps:low_mm=2.4,high_mm=9.6,dwell_s=12,cycles=1")
    smooth = found.nearest
    assert not found.feasible
    assert smooth.scored_from_s == jumps.scored_from_s
    assert smooth.value_mm(33.9) == pytest.approx(9.6, abs=0.05)
    rates = np.diff(smooth.displacement_mm) / np.diff(smooth.times_s)
    assert -12.0 < rates.min() < -1.0
    start = WireState(22.0, LOOP.initial_state(22.0))
    again = simulate_run(smooth, WIRE, HysteresisInverse(LOOP), SETTINGS, start)
    assert again.shortfall_mm < 0.1 * found.shortfall_mm


def test_too_hot_a_run_is_refused_with_the_cure():
    _, found = rehearsed("sine:low_mm=2.4,high_mm=9.6,period_s=56,cycles=1")
    with pytest.raises(ConfigError, match="temperature_max_c = 90: lower its highest displacement"):
        found.check(temperature_max_c=90.0)


@pytest.mark.parametrize(
    ("spec", "doubts"),
    [
        ("sine:low_mm=0.002,high_mm=0.009,period_s=20,cycles=1", 1),  # metres
        ("sine:low_mm=2,high_mm=2.003,period_s=20,cycles=1", 1),
        ("sine:low_mm=2,high_mm=2.2,period_s=20,cycles=1", 0),
        ("trapezoid:low_mm=5,high_mm=5,rise_s=5,cycles=1", 0),  # to hold is meant
    ],
)
def test_a_reference_that_is_lost_in_the_sensors_noise_is_doubted(spec, doubts):
    _, found = rehearsed(spec)
    assert len(found.caveats) == doubts
    assert all("is it in mm?" in caveat and "of a stroke of 12 mm" in caveat for caveat in found.caveats)
