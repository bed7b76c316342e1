"""The observer against a simulated wire whose heat balance it does not quite know."""

import dataclasses

import numpy as np
import pytest

from smadrive.control.observer import WireObserver
from smadrive.hysteresis import DuhemModel
from smadrive.thermal import HeatBalance

TRUE = HeatBalance(0.029, 0.012, 0.83, 22.0, 16.5, -0.12, 0.15)
LOOP = DuhemModel.gaussian(
    mu_heating=90, mu_cooling=69, sigma_heating=5, sigma_cooling=5, scale=12, input_range=(0, 160)
)
DT_S = 0.05


def follow(balance, powers_w, noise_c=0.1, lost=()):
    """(true, read, estimated) temperatures and (true, estimated) displacements of a wire driven by `powers_w`."""
    noise = np.random.default_rng(2)
    observer = WireObserver(balance, LOOP, DT_S, 0.1)
    wire = reading = 22.0
    state = LOOP.initial_state(wire)
    estimate = observer.start(wire, float("nan"))
    rows = []
    for n, power_w in enumerate(powers_w):
        for _ in range(10):
            direction = 1 if TRUE.ambient_c + power_w / TRUE.loss_w_per_k > wire else -1
            after = TRUE.step(wire, power_w, LOOP.slope(state, direction) / LOOP.scale, DT_S / 10)
            reading = TRUE.step_thermocouple(reading, wire, after, DT_S / 10)
            wire, state = after, LOOP.step(state, after)
        read = float("nan") if n in lost else reading + noise.normal(0, noise_c)
        estimate = observer.update(estimate, read, power_w, DT_S)
        rows.append((wire, read, estimate.temperature_c, state.y, estimate.hysteresis.y, estimate.disturbance_w))
    return np.array(rows).T


POWERS = np.repeat([0.85, 0.55, 0.9, 0.6, 0.8], 200)


def rms(values):
    return float(np.sqrt(np.mean(np.square(values))))


def test_the_estimate_beats_the_thermocouple():
    wire, read, estimated, *_ = follow(TRUE, POWERS)
    assert rms(estimated - wire) < 0.5 * rms(read - wire)
    assert rms(estimated - wire) < 0.1


def test_a_wrong_loss_becomes_a_disturbance_and_no_bias():
    wrong = dataclasses.replace(TRUE, loss_w_per_k=TRUE.loss_w_per_k * 1.15)
    wire, _, estimated, *_, unexplained = follow(wrong, np.full(1200, 0.85))
    assert abs(np.mean((estimated - wire)[-200:])) < 0.1
    assert unexplained[-1] == pytest.approx(0.15 * TRUE.loss_w_per_k * (wire[-1] - 22.0), rel=0.2)


def test_the_phase_follows_the_wire_through_turning_points():
    *_, displacement, estimated, _ = follow(TRUE, POWERS)
    assert rms(estimated - displacement) < 0.02 * 12


def test_lost_readings_are_bridged_by_the_heat_balance():
    wire, _, estimated, *_ = follow(TRUE, POWERS, lost=set(range(300, 320)))
    assert rms((estimated - wire)[300:320]) < 0.3


def test_it_starts_at_the_measured_displacement_when_there_is_one():
    observer = WireObserver(TRUE, LOOP, DT_S, 0.1)
    assert observer.start(80.0, 6.0).hysteresis.y == pytest.approx(6.0)
    assert observer.start(80.0, float("nan")).hysteresis.y == pytest.approx(LOOP.initial_state(80.0).y)
