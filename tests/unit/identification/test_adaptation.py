"""Online adaptation of the rules: it follows a wire that changes, stays certified, and detects a faulty sensor."""

from math import nan

import numpy as np
import pytest

from smadrive.hysteresis import DuhemModel, TriangularSets, TSFuzzyDuhem
from smadrive.hysteresis.model import HysteresisState
from smadrive.identification.adaptation.adaptation import Adaptation

MINUTES, PERIOD_S, SAMPLE_S = 20.0, 56.0, 0.25
NOISE_C, NOISE_MM, STROKE_MM = 0.02, 0.012, 12.0
TIMES_S = np.arange(0.0, 60.0 * MINUTES, SAMPLE_S)


def wire(drift_c=0.0, drift=0.0):
    return DuhemModel.gaussian(
        mu_heating=89.9 + drift_c,
        mu_cooling=69.0 + drift_c,
        sigma_heating=5.0,
        sigma_cooling=5.0,
        scale=STROKE_MM * (1.0 + drift),
        input_range=(0.0, 200.0),
    )


@pytest.fixture(scope="module")
def rules():
    sets = TriangularSets((30.0, 55.0, 62.0, 66.0, 70.0, 74.0, 79.0, 84.0, 88.0, 92.0, 96.0, 101.0, 110.0))
    return TSFuzzyDuhem.from_duhem(wire(), sets)


def follow(rules, *, drift_c=0.0, drift=0.0, shown=lambda share, reached_mm: reached_mm, adaptation=None):
    """Return the errors of the fixed and of the adapted rules, in percent of the stroke, and the adaptation."""
    rng = np.random.default_rng(1)
    path_c = 80.0 + (16.0 + 6.0 * np.sin(TIMES_S / 53.0)) * np.sin(2 * np.pi * TIMES_S / PERIOD_S - 1.5)
    adaptation = adaptation or Adaptation(rules, 0.1)
    fixed, state = rules.initial_state(path_c[0]), wire().initial_state(path_c[0])
    errors = []
    for n, v in enumerate(path_c.tolist()):
        share = n / len(path_c)
        if n % 100 == 0:
            true = wire(share * drift_c, share * drift)
            assert adaptation.model.certificate().holds
        state = true.step(HysteresisState(state.v, 0.0, state.w), v)
        fixed = rules.step(fixed, v)
        read_mm = shown(share, state.y) + NOISE_MM * rng.normal()
        adaptation.update(v + NOISE_C * rng.normal(), read_mm)
        errors.append((fixed.y - state.y, adaptation.predicted_mm - state.y))
    fixed_percent, adapted_percent = 100.0 * np.array(errors).T / STROKE_MM
    return fixed_percent, adapted_percent, adaptation


def rms(errors):
    return float(np.sqrt(np.mean(errors**2)))


@pytest.mark.exhaustive
def test_drift_is_followed_with_a_third_of_the_error_and_certified_rules(rules):
    fixed, adapted, adaptation = follow(rules, drift_c=3.0, drift=-0.05)
    assert rms(fixed) > 5.0
    assert rms(adapted) < rms(fixed) / 3.0
    assert adaptation.sensor_fault is None


@pytest.mark.exhaustive
def test_constant_wire_keeps_its_rules(rules):
    fixed, adapted, _ = follow(rules)
    assert rms(adapted) < max(1.1 * rms(fixed), 0.5)


def test_error_of_a_wire_at_rest_is_corrected_once(rules):
    adaptation, state = Adaptation(rules, 0.0), rules.initial_state(40.0)
    for v in np.linspace(40.0, 90.0, 200).tolist():
        state = rules.step(state, v)
        adaptation.update(v, state.y)
    shown_mm = state.y - 0.05 * STROKE_MM
    scales = []
    for n in range(20):
        adaptation.update(90.0 + 0.01 * (n % 2), shown_mm)
        scales.append(adaptation.model.scale / rules.scale)
    assert adaptation.predicted_mm == pytest.approx(shown_mm, abs=0.01 * STROKE_MM)
    assert min(scales) == pytest.approx(scales[-1], abs=0.01)


def test_displacement_that_comes_back_is_no_jump_and_neither_is_its_own_correction(rules):
    """The stroke has grown by a quarter while the displacement was missing. Then the wire travels very slowly."""
    adaptation = Adaptation(rules, 0.001)
    adaptation.update(40.0, rules.initial_state(40.0).y)
    path = np.linspace(40.0, 90.0, 200).tolist()
    slow = np.arange(90.01, 91.0, 0.01).tolist()
    shown = 1.25 * rules.simulate([*path, *slow])
    for v in path:
        adaptation.update(v, nan)
    for v, shown_mm in zip(slow, shown[len(path) :].tolist(), strict=True):
        adaptation.update(v, shown_mm)
    assert adaptation.sensor_fault is None
    assert adaptation.predicted_mm == pytest.approx(shown[-1], abs=0.01 * STROKE_MM)


def test_noise_of_a_cold_wire_at_rest_teaches_nothing(rules):
    rng, adaptation = np.random.default_rng(1), Adaptation(rules, 0.1)

    def rest(samples):
        for _ in range(samples):
            adaptation.update(22.0 + 0.06 * rng.normal(), 0.06 + NOISE_MM * rng.normal())
        return adaptation.model

    for v in np.linspace(60.0, 22.0, 100).tolist():
        adaptation.update(v, 0.0)
    before, after = rest(300), rest(3000)
    path_c = np.concatenate([np.linspace(22.0, 120.0, 500), np.linspace(120.0, 22.0, 500)])
    moved_mm = after.simulate(path_c, 0.0) - before.simulate(path_c, 0.0)
    assert np.abs(moved_mm).max() < 1e-3 * STROKE_MM


@pytest.mark.exhaustive
def test_stuck_sensor_ends_the_adaptation_and_changes_no_rule(rules):
    held = []

    def stuck(share, reached_mm):
        held[:] = held if share > 0.5 else [reached_mm]
        return held[0]

    fixed, adapted, adaptation = follow(rules, shown=stuck)
    assert adaptation.sensor_fault
    assert rms(adapted[-1200:]) < rms(fixed[-1200:]) + 1.0


@pytest.mark.exhaustive
def test_spikes_are_rejected(rules):
    rng = np.random.default_rng(2)
    fixed, adapted, adaptation = follow(
        rules, shown=lambda share, reached_mm: reached_mm + (6.0 * rng.normal() if rng.random() < 0.03 else 0.0)
    )
    assert adaptation.sensor_fault is None
    assert rms(adapted) < rms(fixed) + 1.0


@pytest.mark.exhaustive
def test_displaced_sensor_ends_the_adaptation(rules):
    fixed, adapted, adaptation = follow(rules, shown=lambda share, reached_mm: reached_mm + 4.0 * (share > 0.5))
    assert adaptation.sensor_fault
    assert rms(adapted[-1200:]) < rms(fixed[-1200:]) + 1.0


def test_missing_displacement_changes_no_rule(rules):
    adaptation = Adaptation(rules, 0.1)
    for v in (20.0, 80.0, 100.0, nan, 60.0):
        adaptation.update(v, nan)
    assert adaptation.model.rules == pytest.approx(np.array(rules.rules))
