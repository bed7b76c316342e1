"""Tracking by the resistance of the wire: accuracy, changed leads, the sense current, and sensors that fail."""

from math import inf, nan

import numpy as np
import pytest

from smadrive.control.controllers.tracking import TrackingController
from smadrive.control.controllers.tracking_feedback import TrackingSettings
from smadrive.control.estimation.lead import LeadChange
from smadrive.control.estimation.observer import WireObserver
from smadrive.control.estimation.resistance_sensor import ResistanceSensor
from smadrive.control.estimation.source_comparison import Compared
from smadrive.control.estimation.source_selection import SourceSelection
from smadrive.control.feedforward.displacement import HysteresisInverse
from smadrive.control.references.shapes import sine
from smadrive.hysteresis import DuhemModel
from smadrive.measurement import DisplacementFrom, Measurement
from smadrive.wire.heat_balance import HeatBalance
from smadrive.wire.identified_resistance import WireResistance
from smadrive.wire.observability import sense_current
from smadrive.wire.wire_model import WireModel, WireState

DT_S, STROKE_MM = 0.05, 12.0
RESISTANCE = WireResistance(22.0, 16.5, 0.012, 0.04, 0.004, 0.001, 0.0, (20.0, 80.0, 140.0), (15.0, 15.4, 15.8))
MODEL = DuhemModel.gaussian(
    mu_heating=90, mu_cooling=69, sigma_heating=5, sigma_cooling=5, scale=STROKE_MM, input_range=(0, 160)
)
WIRE = WireModel(MODEL, HeatBalance(0.029, 0.012, 0.83, 22.0, 16.5, -0.12, 0.15), RESISTANCE)
REFERENCE = sine(low_mm=2.4, high_mm=9.6, period_s=16.0, cycles=1).with_approach(0.0, 4.0)


class Bench:
    """A wire with noisy sensors and leads; a command acts one period after the measurement that it answers."""

    def __init__(self, lead_ohm, contact):
        self.lead_ohm, self.contact = lead_ohm, contact
        self.state = WireState(22.0, MODEL.initial_state(22.0))
        self.reading_c, self.time_s = 22.0, 0.0
        self.in_force_a = self.sent_a = 0.0
        self.noise = np.random.default_rng(3)

    def ohm(self):
        return RESISTANCE.ohm(self.state.temperature_c, self.state.hysteresis.y / STROKE_MM)

    def measurement(self, sensor):
        noise, current_a = self.noise, self.in_force_a
        voltage_v = current_a * (self.ohm() + self.lead_ohm(self.time_s)) + noise.normal(0, 0.002)
        measured_a = max(current_a + noise.normal(0, 0.0002), 0.0)
        shown_mm = sensor(self.time_s, self.state.hysteresis.y + noise.normal(0, 0.012))
        reading_c = 22.0 + self.contact(self.time_s) * (self.reading_c - 22.0) + noise.normal(0, 0.1)
        return Measurement(self.time_s, reading_c, measured_a, voltage_v, shown_mm)

    def advance(self, current_a):
        self.in_force_a, self.sent_a = self.sent_a, current_a
        for _ in range(5):
            before = self.state
            self.state = WIRE.step(before, self.in_force_a**2 * self.ohm(), DT_S / 5)
            self.reading_c = WIRE.balance.step_thermocouple(
                self.reading_c, before.temperature_c, self.state.temperature_c, DT_S / 5
            )
        self.time_s += DT_S


def tracked(
    chosen,
    sensor=lambda _time_s, _right_mm: nan,
    lead_ohm=lambda _: 0.0,
    contact=lambda _: 1.0,
    reference=REFERENCE,
    spoiled=None,
):
    """Return the errors in % of the stroke after the approach, and the commands.

    `lead_ohm` and `contact` are functions of the time; `contact` is the share of the rise that the thermocouple reads.
    The sample in the middle of the run has the values `spoiled`.
    """
    settings = TrackingSettings(
        DT_S, 0.6, closed_loop_s=0.25, integral_s=2.0, noise_c=0.1, displacement_from=DisplacementFrom(chosen)
    )
    controller, bench = (
        TrackingController(reference, WIRE, HysteresisInverse(MODEL), settings),
        Bench(lead_ohm, contact),
    )
    errors, commands = [], []
    while bench.time_s < reference.duration_s:
        sample = bench.measurement(sensor)
        if abs(bench.time_s - 0.5 * reference.duration_s) < 0.5 * DT_S:
            sample = sample._replace(**spoiled or {})
        command = controller.update(bench.time_s, sample, DT_S)
        if bench.time_s >= reference.scored_from_s:
            errors.append(100 * (reference.value_mm(bench.time_s) - bench.state.hysteresis.y) / STROKE_MM)
            commands.append(command)
        bench.advance(command.commanded_a)
    return np.array(errors), commands


def right(_time_s, right_mm):
    return right_mm


def test_resistance_replaces_the_sensor():
    errors, commands = tracked("resistance")
    assert np.sqrt(np.mean(errors**2)) < 0.3
    assert all(command.uses_resistance for command in commands)


def test_change_of_the_leads_is_measured_while_the_wire_is_cold():
    errors, _ = tracked("resistance", lead_ohm=lambda _time_s: 0.1)
    assert np.sqrt(np.mean(errors**2)) < 0.8  # 0.1 Ω alone are 6 % of the stroke


def test_source_none_ignores_the_sensor():
    wrong, _ = tracked("none", lambda _time_s, right_mm: right_mm + 3.0)
    blind, _ = tracked("none")
    assert np.array_equal(wrong, blind)


def test_sensor_without_a_reading_is_replaced_without_a_jump():
    errors, commands = tracked("sensor", lambda time_s, right_mm: right_mm if time_s < 10.0 else nan)
    used = np.array([command.uses_resistance for command in commands])
    switch = int(np.argmax(used))
    assert not used[:switch].any()
    assert used[switch:].all()
    assert np.abs(errors[switch:]).max() < 1.2
    currents = np.array([command.commanded_a for command in commands])
    assert np.abs(np.diff(currents))[switch - 1 : switch + 2].max() < 2.0 * np.abs(np.diff(currents)).max()


def test_sensor_that_works_again_is_used_again():
    _, commands = tracked("sensor", lambda time_s, right_mm: nan if 10.0 < time_s < 11.0 else right_mm)
    used = [command.uses_resistance for command in commands]
    assert any(used)
    assert not used[-1]


@pytest.mark.parametrize("over_s", [0.5, 3.0])
def test_bead_that_comes_loose_accuses_no_sensor(over_s):
    """The resistance at the wrong temperature shows a wrong displacement."""
    path = sine(low_mm=2.4, high_mm=9.6, period_s=16.0, cycles=2).with_approach(0.0, 4.0)
    _, commands = tracked(
        "sensor",
        right,
        contact=lambda time_s: float(np.interp(time_s, (12.0, 12.0 + over_s), (1.0, 0.8))),
        reference=path,
    )
    assert not any(command.sensor_replaced for command in commands)


@pytest.mark.parametrize(
    "sensor",
    [
        lambda time_s, right_mm: right_mm + (1.0 if time_s > 10.0 else 0.0),
        lambda time_s, right_mm: right_mm if time_s < 10.0 else 6.0,
    ],
    ids=["slipped", "stuck"],
)
def test_implausible_sensor_is_replaced(sensor):
    errors, commands = tracked("sensor", sensor)
    assert commands[-1].uses_resistance
    assert np.abs(errors[-100:]).max() < 1.5


@pytest.mark.parametrize("contact_ohm", [0.3, 0.5, 1.0, 2.0])
def test_right_sensor_stays_the_source_when_a_contact_changes(contact_ohm):
    """Without a reading of the sensor, the displacement is not known: the resistance is wrong."""

    def sensor(time_s, right_mm):
        return nan if 14.0 < time_s < 14.3 else right_mm

    errors, commands = tracked("sensor", sensor, lead_ohm=lambda time_s: contact_ohm if time_s > 8.0 else 0.0)
    assert not any(command.uses_resistance for command in commands)
    assert np.abs(errors).max() < 2.0


WRONG = [
    Compared(failed=True, has_sensor=True),
    Compared(disagreement_mm=1.0, valid_ticks=21, has_sensor=True, is_confirmed=False),
]


@pytest.mark.parametrize("compared", WRONG)
@pytest.mark.parametrize("between", [DisplacementFrom.RESISTANCE, DisplacementFrom.NONE])
def test_wrong_sensor_stays_wrong_when_another_source_was_chosen_meanwhile(between, compared):
    first, second, third = (
        SourceSelection(chosen, ResistanceSensor(WIRE, RESISTANCE, DT_S), 0.01, STROKE_MM, DT_S, 0.5)
        for chosen in (DisplacementFrom.SENSOR, between, DisplacementFrom.SENSOR)
    )
    other = second.adopt(first.start()._replace(compared=compared, is_replaced=True), first)
    assert other.needs_resistance is False  # so that the source "none" needs no sense current
    back = third.adopt(other, second)
    assert other.compared.is_sensor_wrong
    assert (back.compared.is_sensor_wrong, back.is_replaced, back.compared.failed) == (True, True, compared.failed)


def test_spikes_do_not_make_a_sensor_fail():
    _, commands = tracked("sensor", lambda time_s, right_mm: right_mm + (1.0 if round(time_s / DT_S) % 40 == 0 else 0))
    assert not all(command.uses_resistance for command in commands[-30:])


SPOILED = [
    {"current_a": 6.0},
    {"current_a": 0.02},
    {"voltage_v": 60.0},
    {"temperature_c": 3.4e38},
    {"temperature_c": -1e4},
]
"""Samples with one wrong value, as after a disturbed conversion."""


@pytest.mark.parametrize("spoiled", SPOILED)
def test_sample_with_a_wrong_value_does_not_make_a_right_sensor_fail(spoiled):
    errors, commands = tracked("sensor", right, spoiled=spoiled)
    assert not commands[-1].uses_resistance
    assert abs(commands[-1].by_resistance_mm - commands[-1].estimated_mm) < 0.03 * STROKE_MM
    assert np.abs(errors[-60:]).max() < 0.5


@pytest.mark.parametrize("spoiled", SPOILED)
def test_sample_with_a_wrong_value_is_soon_forgotten_by_resistance(spoiled):
    errors, _ = tracked("resistance", spoiled=spoiled)
    assert np.abs(errors[-60:]).max() < 1.5


def test_sense_current_flows_while_the_wire_cools():
    falling = sine(low_mm=1.0, high_mm=11.0, period_s=6.0, cycles=1).with_approach(0.0, 6.0)
    _, commands = tracked("resistance", reference=falling)
    _, blind = tracked("none", reference=falling)
    floor_a = sense_current(WIRE, RESISTANCE).current_a
    assert min(command.commanded_a for command in commands) > 0.99 * floor_a
    assert min(command.commanded_a for command in blind) < 0.5 * floor_a


def test_right_sensor_stays_in_use():
    errors, commands = tracked("sensor", right)
    assert not any(command.uses_resistance for command in commands)
    assert np.sqrt(np.mean(errors**2)) < 0.2


@pytest.mark.parametrize(("change_ohm", "samples"), [(0.0, 40), (0.05, 40)])
def test_lead_estimate_is_unchanged_or_measured(change_ohm, samples):
    noise, lead = np.random.default_rng(1), LeadChange.unknown(16.5)
    for _ in range(samples):
        lead = lead.later(16.5, DT_S).measured(change_ohm + noise.normal(0.0, 0.02), 0.02**2)
    ohm, variance = lead.estimate(1e-6)
    assert abs(ohm - change_ohm) < 0.006
    assert 0.0 < variance < inf


def test_lead_estimate_does_not_follow_a_sensor_that_slides():
    lead = LeadChange.unknown(16.5)
    for n in range(1400):
        lead = lead.later(16.5, DT_S).measured(0.0 if n < 1200 else 0.1, 0.013**2)
    assert abs(lead.mean_ohm) < 0.02


def test_wire_is_cold_only_below_the_temperatures_of_a_smaller_load():
    sensor = ResistanceSensor(WIRE, RESISTANCE, DT_S)
    estimate = WireObserver(WIRE, DT_S, 0.1, 0.012).start(sensor.cold_c - 1.0, nan)
    assert sensor.is_cold(estimate)
    assert not sensor.is_cold(estimate._replace(shift_c=-8.0))
    assert sensor.is_cold(estimate._replace(shift_c=8.0))


def test_sense_current_flows_after_a_tick_without_a_displacement():
    sensor = ResistanceSensor(WIRE, RESISTANCE, DT_S)
    floors_a = {}
    for chosen in DisplacementFrom:
        selection = SourceSelection(chosen, sensor, 0.012, STROKE_MM, DT_S, 0.5)
        assert selection.start().source is DisplacementFrom.NONE
        floors_a[chosen] = selection.floor_a(selection.start())
    assert floors_a[DisplacementFrom.RESISTANCE] == sensor.floor_a > 0.0
    assert floors_a[DisplacementFrom.SENSOR] == floors_a[DisplacementFrom.NONE] == 0.0
