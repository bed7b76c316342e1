"""The observer estimates a simulated wire whose true heat balance differs a little from that of the observer."""

import dataclasses

import numpy as np
import pytest

from smadrive.control.estimation.innovation import DisturbanceEvidence
from smadrive.control.estimation.observer import MOST_DRAFT, WireObserver
from smadrive.hysteresis import DuhemModel
from smadrive.hysteresis.reversal import Play
from smadrive.wire.heat_balance import HeatBalance
from smadrive.wire.identified_resistance import WireResistance
from smadrive.wire.wire_model import WireModel

TRUE = HeatBalance(0.029, 0.012, 0.83, 22.0, 16.5, -0.12, 0.15)
LOOP = DuhemModel.gaussian(
    mu_heating=90, mu_cooling=69, sigma_heating=5, sigma_cooling=5, scale=12, input_range=(0, 160)
)
DT_S = 0.05


def follow(balance, powers_w, noise_c=0.1, lost=(), model=LOOP, noise_mm=None, losses=None, shifts_c=None):
    """Return the rows of (true, read, estimated) temperatures, shift, (true, estimated) displacements, and power.

    Shift and power are those that the observer estimates. The wire is driven by `powers_w`. The displacement is
    measured where it has a noise. `losses` are factors of the true heat loss, `shifts_c` true shifts of the
    transformation, one per power.
    """
    losses = np.ones(len(powers_w)) if losses is None else losses
    shifts_c = np.zeros(len(powers_w)) if shifts_c is None else shifts_c
    noise = np.random.default_rng(2)
    observer = WireObserver(WireModel(model, balance), DT_S, 0.1, 0.012)
    wire = reading = 22.0
    state = LOOP.initial_state(wire)
    estimate = observer.start(wire, float("nan"))
    rows = []
    for n, power_w in enumerate(powers_w):
        air = dataclasses.replace(TRUE, loss_w_per_k=losses[n] * TRUE.loss_w_per_k)
        for _ in range(10):
            direction = 1 if air.ambient_c + power_w / air.loss_w_per_k > wire else -1
            after = air.step(wire, power_w, LOOP.slope(state, direction) / LOOP.scale, DT_S / 10)
            reading = air.step_thermocouple(reading, wire, after, DT_S / 10)
            wire, state = after, LOOP.step(state, after - shifts_c[n])
        read = float("nan") if n in lost else reading + noise.normal(0, noise_c)
        seen_mm = float("nan") if noise_mm is None else state.y + noise.normal(0, noise_mm)
        estimate = observer.update(estimate, read, seen_mm, power_w, DT_S)
        temperatures, displacements = (wire, read, estimate.temperature_c), (state.y, estimate.hysteresis.y)
        rows.append((*temperatures, estimate.shift_c, *displacements, estimate.disturbance_w))
    return np.array(rows).T


POWERS = np.repeat([0.85, 0.55, 0.9, 0.6, 0.8], 200)


def rms(values):
    return float(np.sqrt(np.mean(np.square(values))))


def test_estimate_beats_the_thermocouple():
    wire, read, estimated, *_ = follow(TRUE, POWERS)
    assert rms(estimated - wire) < 0.5 * rms(read - wire)
    assert rms(estimated - wire) < 0.1


def test_wrong_loss_becomes_a_disturbance_and_no_bias():
    wrong = dataclasses.replace(TRUE, loss_w_per_k=TRUE.loss_w_per_k * 1.15)
    wire, _, estimated, *_, unexplained = follow(wrong, np.full(1200, 0.85))
    assert abs(np.mean((estimated - wire)[-200:])) < 0.1
    assert unexplained[-1] == pytest.approx(0.15 * TRUE.loss_w_per_k * (wire[-1] - 22.0), rel=0.2)


@pytest.mark.parametrize("factor", [0.7, 1.3, 1.6])
def test_draft_is_found_within_a_second_without_displacement(factor):
    """The draft grows and ceases within a second. The wire then follows the other branch, and so does the estimate."""
    ramp = np.linspace(1.0, factor, 20)
    losses = np.concatenate([np.ones(340), ramp, np.full(300, factor), ramp[::-1], np.ones(340)])
    wire, _, estimated, _, displacement, blind, unexplained = follow(TRUE, POWERS, losses=losses)
    found_w = (1.0 - factor) * TRUE.loss_w_per_k * (wire - TRUE.ambient_c)
    assert np.abs(unexplained - found_w)[380:660] == pytest.approx(0.0, abs=0.15)
    assert rms((estimated - wire)[380:660]) < 0.15
    assert rms((blind - displacement)[340:]) < 0.03 * 12


def test_unexplained_power_above_the_loss_does_not_grow_with_the_temperature_that_it_raises():
    observer, nothing = WireObserver(WireModel(LOOP, TRUE), DT_S, 0.1, 0.012), float("nan")
    estimate = observer.start(22.0, nothing)._replace(temperature_c=60.0, disturbance_w=2.0)
    for _ in range(4000):
        estimate = observer.update(estimate, nothing, nothing, 0.0, DT_S)
    assert estimate.disturbance_w == 2.0
    assert estimate.temperature_c == pytest.approx(TRUE.ambient_c + 2.0 / TRUE.loss_w_per_k, abs=1.0)


def test_draft_is_limited_without_displacement():
    """A reading of half the rise looks like a draft, but the bead may have come off."""
    observer = WireObserver(WireModel(LOOP, TRUE), DT_S, 0.1, 0.012)
    estimate = observer.start(80.0, float("nan"))
    for _ in range(400):
        estimate = observer.update(estimate, 80.0, float("nan"), 2.0 * TRUE.loss_w_per_k * 58.0, DT_S)
    limit_w = MOST_DRAFT * TRUE.loss_w_per_k * (estimate.temperature_c - TRUE.ambient_c)
    assert estimate.disturbance_w == pytest.approx(-limit_w)


def test_phase_follows_the_wire_through_turning_points():
    *_, displacement, estimated, _ = follow(TRUE, POWERS)
    assert rms(estimated - displacement) < 0.02 * 12


def test_lost_readings_are_bridged_by_the_heat_balance():
    wire, _, estimated, *_ = follow(TRUE, POWERS, lost=set(range(300, 320)))
    assert rms((estimated - wire)[300:320]) < 0.3


def test_estimate_starts_at_a_measured_displacement():
    observer = WireObserver(WireModel(LOOP, TRUE), DT_S, 0.1, 0.012)
    assert observer.start(80.0, 6.0).hysteresis.y == pytest.approx(6.0)
    assert observer.start(80.0, float("nan")).hysteresis.y == pytest.approx(LOOP.initial_state(80.0).y)


def test_small_error_of_the_zero_does_not_warm_the_estimate_of_a_cold_wire():
    """At the cold end the branches are flat: 0.1 mm of 12 mm would count as 30 K."""
    observer = WireObserver(WireModel(LOOP, TRUE), DT_S, 0.1, 0.012)
    estimate = observer.start(22.0, 0.1)
    for _ in range(100):
        estimate = observer.update(estimate, 22.0, 0.1, 0.0, DT_S)
    assert estimate.temperature_c == pytest.approx(22.0, abs=0.1)
    assert estimate.disturbance_w == pytest.approx(0.0, abs=0.001)


def test_displacement_sensor_corrects_the_phase_of_a_wrong_model():
    shifted = DuhemModel.gaussian(
        mu_heating=92, mu_cooling=70, sigma_heating=6, sigma_cooling=6, scale=12, input_range=(0, 160)
    )
    *_, displacement, blind, _ = follow(TRUE, POWERS, model=shifted)
    *_, displacement, seeing, _ = follow(TRUE, POWERS, model=shifted, noise_mm=0.012)
    assert rms(blind - displacement) > 0.05 * 12
    assert rms(seeing - displacement) < 0.005 * 12


def test_displacement_sensor_improves_the_temperature_in_a_draft():
    losses = np.where(np.arange(len(POWERS)) < 600, 1.0, 1.3)
    wire, _, blind, *_ = follow(TRUE, POWERS, losses=losses)
    _, _, seeing, *_ = follow(TRUE, POWERS, noise_mm=0.012, losses=losses)
    assert rms(seeing - wire) < rms(blind - wire)


AT_REST_THEN_CHANGED = np.concatenate((np.zeros(400), np.linspace(0.0, 1.0, 20), np.ones(180)))
HEATING = np.concatenate((np.full(300, 0.75), np.linspace(0.75, 1.0, 300)))


@pytest.mark.parametrize("shift_c", [-6.0, 6.0])
def test_load_becomes_a_shift_with_a_displacement_sensor(shift_c):
    wire, _, estimated, shift, *_, power_w = follow(
        TRUE, HEATING, noise_mm=0.012, shifts_c=shift_c * AT_REST_THEN_CHANGED
    )
    assert shift[:400] == pytest.approx(0.0, abs=0.7)
    assert shift[-1] == pytest.approx(shift_c, abs=2.0)
    assert abs(power_w[-1]) < 0.1 * TRUE.loss_w_per_k * (wire[-1] - TRUE.ambient_c)
    assert rms((estimated - wire)[-40:]) < 0.4


def test_draft_becomes_a_power_with_a_displacement_sensor():
    wire, _, estimated, shift, *_, power_w = follow(
        TRUE, HEATING, noise_mm=0.012, losses=1.0 + 0.6 * AT_REST_THEN_CHANGED
    )
    assert power_w[-1] == pytest.approx(-0.6 * TRUE.loss_w_per_k * (wire[-1] - TRUE.ambient_c), rel=0.2)
    assert abs(shift[-1]) < 1.0
    assert rms((estimated - wire)[-40:]) < 0.4


def test_hot_reading_does_not_move_the_measured_displacement():
    """The wire has just left the heating branch in a disturbance. A hotter wire would be farther along this branch."""
    observer, state = WireObserver(WireModel(LOOP, TRUE), DT_S, 0.1, 0.012), LOOP.initial_state(88.0)
    estimate = observer.start(88.0, state.y)._replace(evidence=DisturbanceEvidence(level=1.0), play=Play(88.0, -1))
    estimate = observer.update(estimate, 88.4, state.y, 0.99 * TRUE.power_w(88.0, 0.0, 0.0), DT_S)
    assert estimate.temperature_c > 88.0
    assert abs(estimate.hysteresis.y - state.y) < 4 * 0.012


def test_contradiction_of_both_sensors_makes_no_impossible_power():
    """The thermocouple reads 30 K more than the wire has at this displacement, with the largest shift 20 K more."""
    observer, state = WireObserver(WireModel(LOOP, TRUE), DT_S, 0.1, 0.012), LOOP.initial_state(80.0)
    estimate, unexplained_w = observer.start(80.0, state.y), []
    for _ in range(200):
        estimate = observer.update(estimate, 110.0, state.y, TRUE.power_w(110.0, 0.0, 0.0), DT_S)
        unexplained_w.append(estimate.disturbance_w)
    assert np.abs(unexplained_w).max() < 5.0
    assert estimate.temperature_c > 95.0


def test_innovation_that_repeats_counts_whole_and_a_spike_does_not():
    """A lighter load moves a wire on its heating branch."""
    observer, state = WireObserver(WireModel(LOOP, TRUE), DT_S, 0.1, 0.012), LOOP.initial_state(88.0)
    power_w, off_mm = TRUE.power_w(88.0, 0.0, 0.0), 0.5
    before = observer.start(88.0, state.y)
    errors_mm = []
    for seen_mm in (state.y + off_mm, state.y + 2.0 * off_mm):
        before = observer.update(before, 88.0, seen_mm, power_w, DT_S)
        errors_mm.append(seen_mm - before.hysteresis.y)
    assert errors_mm[0] > 0.3 * off_mm
    assert errors_mm[1] < 0.6 * errors_mm[0]


@pytest.mark.parametrize("spent_s", [0.0, 100.0], ids=["begins", "lasts"])
def test_displacement_of_a_disturbed_wire_is_followed_where_the_model_does_not_move(spent_s):
    """A changed load moves the wire at a constant temperature. The displacement has the noise of the resistance."""
    resistance = WireResistance(22.0, 16.5, 0.01, 0.04, 0.01, 0.01, 0.0, (0.0, 80.0, 160.0), (14.0,) * 3)
    observer, state = WireObserver(WireModel(LOOP, TRUE, resistance), DT_S, 0.1, 0.012), LOOP.initial_state(88.0)
    state = LOOP.step(state, 82.0)
    evidence = DisturbanceEvidence(spent_s=spent_s, lasting=1.0)
    estimate = observer.start(82.0, state.y)._replace(evidence=evidence, play=Play(82.0, 1))
    for _ in range(2):
        estimate = observer.update(
            estimate, 82.0, state.y - 1.0, TRUE.power_w(82.0, 0.0, 0.0), DT_S, 0.12, by_sensor=False
        )
    assert estimate.hysteresis.y < state.y - 0.65


@pytest.mark.parametrize("noise_mm", [0.006, 0.12])
def test_draft_has_a_bound_by_resistance_however_small_its_noise(noise_mm):
    """A bead that has come off looks like a draft, and the resistance cannot exclude that."""
    resistance = WireResistance(22.0, 16.5, 0.01, 0.04, 0.01, 0.01, 0.0, (0.0, 80.0, 160.0), (14.0,) * 3)
    observer, state = WireObserver(WireModel(LOOP, TRUE, resistance), DT_S, 0.1, 0.012), LOOP.initial_state(88.0)
    found = []
    for by_sensor in (True, False):
        estimate = observer.start(88.0, state.y)._replace(disturbance_w=-3.0)
        power_w = TRUE.power_w(88.0, 0.0, 0.0) + 3.0
        found.append(observer.update(estimate, 88.0, state.y, power_w, DT_S, noise_mm, by_sensor=by_sensor))
    assert observer.cooling(found[0]) > 2.5
    assert observer.cooling(found[1]) < 2.0


def test_observer_continues_from_the_estimate_of_another():
    other = DuhemModel.gaussian(
        mu_heating=88, mu_cooling=70, sigma_heating=6, sigma_cooling=6, scale=12, input_range=(0, 160)
    )
    observer = WireObserver(WireModel(LOOP, TRUE), DT_S, 0.1, 0.012)
    before = observer.start(85.0, 6.0)
    after = WireObserver(WireModel(other, TRUE), DT_S, 0.1, 0.012).adopt(before, observer)
    assert after.temperature_c == before.temperature_c
    assert after.hysteresis.y == pytest.approx(before.hysteresis.y)


def test_estimate_stays_within_the_states_of_the_model():
    observer = WireObserver(WireModel(LOOP, TRUE), DT_S, 0.1, 0.012)
    estimate = observer.start(22.0, float("nan"))
    for _ in range(100):
        estimate = observer.update(estimate, 22.0, -3.0, 0.0, DT_S)
    low, high = LOOP.admissible(estimate.hysteresis.v)
    assert low <= estimate.hysteresis.w <= high
