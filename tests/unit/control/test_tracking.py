"""The tracking controller on a simulated wire: its accuracy, the trim of model errors, and changes during a run."""

import dataclasses
from math import nan

import numpy as np
import pytest

from smadrive.control.controllers.tracking import TrackingController
from smadrive.control.controllers.tracking_feedback import TrackingSettings
from smadrive.control.feedforward.displacement import HysteresisInverse
from smadrive.control.feedforward.static_map import StaticMap
from smadrive.control.references.reference import Reference
from smadrive.control.references.shapes import sine
from smadrive.hysteresis import DuhemModel
from smadrive.measurement import Measurement
from smadrive.wire.heat_balance import HeatBalance
from smadrive.wire.wire_model import WireModel, WireState

DT_S = 0.05
SETTINGS = TrackingSettings(DT_S, 0.6, closed_loop_s=0.25, integral_s=2.0, noise_c=0.1)
BALANCE = HeatBalance(0.029, 0.012, 0.83, 22.0, 16.5, -0.12, 0.15)


def loop(shift_k=0.0, width=5.0):
    return DuhemModel.gaussian(
        mu_heating=90 + shift_k,
        mu_cooling=69 + shift_k,
        sigma_heating=width,
        sigma_cooling=width,
        scale=12,
        input_range=(0, 160),
    )


class Bench:
    """A wire with noisy sensors; a command acts one period after the measurement that it answers."""

    def __init__(self, wire, sensor, noise_c=0.1):
        self.wire, self.sensor, self.noise_c = wire, sensor, noise_c
        self.state = WireState(22.0, wire.model.initial_state(22.0))
        self.reading_c, self.time_s = 22.0, 0.0
        self.in_force_a = self.sent_a = 0.0
        self.noise = np.random.default_rng(7)

    def measurement(self):
        seen_mm = self.state.hysteresis.y + self.noise.normal(0, 0.012) if self.sensor else nan
        ohm = self.wire.balance.resistance_ohm(self.state.hysteresis.w)
        reading_c = self.reading_c + self.noise.normal(0, self.noise_c)
        return Measurement(
            self.time_s, reading_c, self.in_force_a, self.in_force_a * ohm, seen_mm, in_force_a=self.in_force_a
        )

    def advance(self, current_a):
        self.in_force_a, self.sent_a = self.sent_a, current_a
        for _ in range(5):
            before = self.state
            power_w = self.in_force_a**2 * self.wire.balance.resistance_ohm(before.hysteresis.w)
            self.state = self.wire.step(before, power_w, DT_S / 5)
            self.reading_c = self.wire.balance.step_thermocouple(
                self.reading_c, before.temperature_c, self.state.temperature_c, DT_S / 5
            )
        self.time_s += DT_S

    def run(self, controller, until_s):
        """Rows of (time, reference, displacement, commanded power)."""
        rows = []
        while self.time_s < until_s:
            command = controller.update(self.time_s, self.measurement(), DT_S)
            rows.append((self.time_s, command.setpoint_mm, self.state.hysteresis.y, command.power_w))
            self.advance(command.commanded_a)
        return np.array(rows)


def controller(reference, model, balance=BALANCE, settings=SETTINGS, before=None):
    made = TrackingController(reference, WireModel(model, balance), HysteresisInverse(model), settings)
    if before is not None:
        made.take_over(before)
    return made


REFERENCE = sine(low_mm=2.4, high_mm=9.6, period_s=56.0, cycles=1.0).with_approach(0.0, 10.0)


def errors_percent(rows):
    scored = rows[rows[:, 0] >= REFERENCE.scored_from_s]
    error = 100 * (scored[:, 1] - scored[:, 2]) / 12
    return float(np.sqrt(np.mean(error**2))), float(np.max(np.abs(error)))


def track(known, sensor, balance=BALANCE):
    bench = Bench(WireModel(loop(), BALANCE), sensor)
    return errors_percent(bench.run(controller(REFERENCE, known, balance), REFERENCE.duration_s))


@pytest.mark.parametrize(("sensor", "rms_percent", "max_percent"), [(False, 0.4, 1.0), (True, 0.1, 0.5)])
def test_known_wire_is_tracked_to_a_fraction_of_a_percent(sensor, rms_percent, max_percent):
    rms, largest = track(loop(), sensor)
    assert rms < rms_percent
    assert largest < max_percent


def test_wrong_heat_balance_increases_the_error_little():
    wrong = dataclasses.replace(BALANCE, loss_w_per_k=0.0138, heat_capacity_j_per_k=0.026, latent_heat_j=0.7)
    assert track(loop(), sensor=False, balance=wrong)[0] < 0.6


def test_displacement_sensor_compensates_a_wrong_model():
    wrong = loop(shift_k=1.0, width=6.0)
    blind, seeing = track(wrong, sensor=False)[0], track(wrong, sensor=True)[0]
    assert blind > 3.0
    assert seeing < 0.4


def swapped(change):
    """Return the commanded powers around a change of controllers at 30 s, and the rows after the change."""
    bench = Bench(WireModel(loop(), BALANCE), sensor=True)
    first = controller(REFERENCE, loop())
    before = bench.run(first, 30.0)
    after = bench.run(change(first), REFERENCE.duration_s)
    return before[:, 3], after[:, 3], after


@pytest.mark.parametrize(
    "change",
    [
        lambda before: controller(REFERENCE, loop(), before=before),
        lambda before: controller(REFERENCE, loop(shift_k=0.3, width=5.5), before=before),
        lambda before: controller(
            REFERENCE, loop(), settings=dataclasses.replace(SETTINGS, closed_loop_s=0.4), before=before
        ),
        lambda before: controller(
            REFERENCE, loop(), balance=dataclasses.replace(BALANCE, loss_w_per_k=0.0125), before=before
        ),
    ],
    ids=["nothing", "model", "gains", "heat balance"],
)
def test_change_during_a_run_makes_no_jump_and_tracks_on(change):
    before, after, rows = swapped(change)
    steady = np.abs(np.diff(before[-100:])).max()
    assert abs(after[0] - before[-1]) < 2.0 * steady + 0.002
    error = 100 * (rows[:, 1] - rows[:, 2]) / 12
    assert np.sqrt(np.mean(error**2)) < 0.3


def test_new_reference_is_approached_from_the_present_displacement():
    bench = Bench(WireModel(loop(), BALANCE), sensor=True)
    first = controller(REFERENCE, loop())
    bench.run(first, 30.0)
    here_mm = first.state.prediction.before.hysteresis.y
    there = Reference.from_samples([0.0, 30.0, 34.0, 50.0], [here_mm, here_mm, 5.0, 5.0])
    rows = bench.run(controller(there, loop(), before=first), 50.0)
    assert np.abs(rows[-100:, 2] - 5.0).max() < 0.01 * 12


def test_lost_reading_is_bridged():
    bench = Bench(WireModel(loop(), BALANCE), sensor=False)
    tracker = controller(REFERENCE, loop())
    bench.run(tracker, 25.0)
    for _ in range(10):
        command = tracker.update(bench.time_s, bench.measurement()._replace(temperature_c=nan), DT_S)
        bench.advance(command.commanded_a)
    assert abs(bench.state.hysteresis.y - REFERENCE.value_mm(bench.time_s)) < 0.01 * 12


def test_unknown_power_is_that_of_the_current_in_force_not_of_the_last_command():
    held = Reference.from_samples([0.0, 40.0], [3.0, 3.0])
    bench, knowing = Bench(WireModel(loop(), BALANCE), sensor=True), controller(held, loop())
    bench.run(knowing, 20.0)
    jumping = controller(Reference.from_samples([0.0, 40.0], [8.0, 8.0]), loop(), before=knowing)
    bench.run(jumping, 20.05)
    assert bench.sent_a - bench.in_force_a > 0.1
    sample = bench.measurement()
    unknowing = controller(held, loop(), before=jumping)
    seen = jumping.update(20.05, sample, DT_S).estimated_c
    assert unknowing.update(20.05, sample._replace(voltage_v=nan), DT_S).estimated_c == pytest.approx(seen, abs=0.1)


def test_measured_wire_is_soon_back_after_a_jump_of_the_setpoint():
    """Full heat needs some 0.1 s for 5 mm, and a command acts one period later."""
    held = Reference.from_samples([0.0, 40.0], [3.0, 3.0])
    bench, first = Bench(WireModel(loop(), BALANCE), sensor=True), controller(held, loop())
    bench.run(first, 20.0)
    rows = bench.run(controller(Reference.from_samples([0.0, 40.0], [8.0, 8.0]), loop(), before=first), 22.0)
    away_s = rows[np.abs(rows[:, 2] - 8.0) > 0.01 * 12.0, 0]
    assert away_s.max() - 20.0 < 0.45


def test_current_is_zero_until_the_first_reading_of_the_temperature():
    bench = Bench(WireModel(loop(), BALANCE), sensor=True)
    first = controller(REFERENCE, loop())
    unknown = bench.measurement()._replace(temperature_c=nan)
    assert first.update(0.0, unknown, DT_S).commanded_a == 0.0
    assert first.state is None
    assert first.update(DT_S, bench.measurement(), DT_S).power_w >= 0.0
    assert first.state is not None


@pytest.mark.parametrize(("recorded_c", "least_c"), [(0.4, 0.1), (0.1, 0.4)])
def test_controller_assumes_the_larger_noise_of_record_and_settings(recorded_c, least_c):
    """A controller that assumes too little noise takes it for reversals of the wire; the error is then 4 %."""
    reference = sine(low_mm=2.0, high_mm=9.0, period_s=56.0, cycles=1.0).with_approach(0.0, 10.0)
    bench = Bench(WireModel(loop(), BALANCE), sensor=False, noise_c=0.4)
    balance = dataclasses.replace(BALANCE, thermocouple_noise_c=recorded_c)
    settings = dataclasses.replace(SETTINGS, noise_c=least_c)
    rows = bench.run(controller(reference, loop(), balance, settings), 66.0)
    error_mm = (rows[:, 1] - rows[:, 2])[rows[:, 0] > 10.0]
    assert np.sqrt(np.mean(error_mm**2)) < 0.01 * 12.0


def reversals(current_a, least_a):
    """Return the times at which the current has reversed by more than `least_a`."""
    direction, extreme_a, found = 0, current_a[0], []
    for number, now_a in enumerate(current_a):
        turn = int(np.sign(now_a - extreme_a)) if abs(now_a - extreme_a) > least_a else 0
        if turn and turn != direction:
            found += [number * DT_S] if direction else []
            direction, extreme_a = turn, now_a
        elif direction * (now_a - extreme_a) > 0.0:
            extreme_a = now_a
    return np.array(found)


@pytest.mark.parametrize(
    ("high_mm", "period_s", "width", "seed"), [(8.0, 70.0, 5.0, 0), (9.6, 50.0, 8.0, 0), (11.0, 70.0, 8.0, 0)]
)
def test_current_does_not_chatter_while_the_wire_crosses_its_hysteresis(high_mm, period_s, width, seed):
    reference = sine(low_mm=2.4, high_mm=high_mm, period_s=period_s, cycles=1).with_approach(0.0, 8.0)
    bench = Bench(WireModel(loop(width=width), BALANCE), sensor=True)
    bench.noise = np.random.default_rng(seed)
    rows = bench.run(controller(reference, loop(width=width)), reference.duration_s)
    power_w = rows[rows[:, 0] >= reference.scored_from_s, 3]
    found = reversals(np.sqrt(power_w / BALANCE.resistance_ohm(0.5)), 0.2 * SETTINGS.current_limit_a)
    assert all(np.count_nonzero((found >= begun) & (found < begun + 1.0)) == 1 for begun in found)


@pytest.mark.parametrize("turns_back", [False, True])
def test_decision_to_turn_back_holds_in_the_next_tick(turns_back):
    """The wire leads a slow reference by 0.9 % of the stroke, which is between the two tolerances."""
    at_rest, rising = ([0.0, 8.0, 60.0], [0.0, 6.0, 6.0]), ([0.0, 60.0], [5.73, 6.21])
    bench, before = Bench(WireModel(loop(), BALANCE), sensor=True), controller(Reference.from_samples(*at_rest), loop())
    bench.run(before, 20.0)
    before._state = before.state._replace(target=before.state.target._replace(turns_back=turns_back))
    decided = controller(Reference.from_samples(*rising), loop(), before=before)
    bench.run(decided, 20.02)
    assert decided.state.target.turns_back == turns_back


def test_setpoint_of_a_map_is_not_filtered():
    """A map does not divide by the slope of the wire."""
    sweep_c = np.concatenate((np.linspace(20, 130, 500), np.linspace(130, 20, 500)))
    plain = StaticMap(sweep_c, loop().simulate(sweep_c))
    reference = Reference.from_samples([0.0, 9.0, 12.0, 12.01, 20.0], [0.0, 8.0, 8.0, 7.4, 7.4])
    bench = Bench(WireModel(loop(), BALANCE), sensor=True)
    tracking, setpoints_c, wanted_c = TrackingController(reference, bench.wire, plain, SETTINGS), [], []
    for until_s, setpoint_mm in ((11.93, 8.0), (12.02, 7.4)):
        bench.run(tracking, until_s)
        setpoints_c.append(tracking.state.target.temperature_c)
        wanted_c.append(plain.target(bench.state.hysteresis, setpoint_mm + tracking.state.trim_mm, 1).temperature_c)
    assert np.diff(setpoints_c) == pytest.approx(np.diff(wanted_c), rel=0.1)
