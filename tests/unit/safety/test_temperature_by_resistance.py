"""The check of the thermocouple by the resistance, for a wire without a displacement sensor."""

from dataclasses import replace
from math import exp, nan

import pytest

from smadrive.hysteresis import DuhemModel
from smadrive.measurement import DisplacementFrom, Measurement
from smadrive.safety.displacement_band import DisplacementBand
from smadrive.safety.faults import Fault
from smadrive.safety.supervisor import Supervisor
from smadrive.safety.temperature_band import IDENTIFIED, UNBOUNDED, TemperatureBand
from smadrive.safety.temperature_by_resistance import TemperatureByResistance, by_sensor
from smadrive.wire.heat_balance import HeatBalance
from smadrive.wire.identified_resistance import WireResistance
from smadrive.wire.wire_model import WireModel
from tests.unit.safety import limits

MODEL = DuhemModel.gaussian(
    mu_heating=90.0, mu_cooling=69.0, sigma_heating=5.0, sigma_cooling=5.0, scale=12.0, input_range=(0.0, 200.0)
)
BALANCE = HeatBalance(0.0298, 0.014, 0.83, 22.0, 16.5, -0.12, 0.15)
AUSTENITE_OHM = (16.0, 16.5, 17.0)
RESISTANCE = WireResistance(22.0, 17.0, 0.008, 0.04, 0.004, 0.001, 0.01, (20.0, 80.0, 140.0), AUSTENITE_OHM)
WIRE = WireModel(MODEL, BALANCE, RESISTANCE)
MOST_C = 135.0
HOTTEST_C = 150.0
LIMITS = replace(limits.LIMITS, temperature_max_c=MOST_C, contradicts_for_s=2.0)


def by_resistance(source=by_sensor, current_max_a=0.5):
    return TemperatureByResistance(WIRE, RESISTANCE, DisplacementBand(MODEL), MOST_C, current_max_a, source)


def sample(wire_c, phase, n=0, reading_c=None, current_a=0.3, displacement_mm=nan):
    """A measurement of a wire at this temperature and phase. By default the thermocouple reads it, and flickers."""
    voltage_v = current_a * RESISTANCE.ohm(wire_c, phase)
    read_c = (wire_c if reading_c is None else reading_c) + 0.1 * (n % 2)
    return Measurement(0.05 * n, read_c, current_a, voltage_v, displacement_mm, armed=True, in_force_a=current_a)


@pytest.mark.parametrize(
    ("wire_c", "phase", "excluded"),
    [(22.0, 0.0, True), (85.0, 0.2, True), (88.0, 0.5, True), (MOST_C, 1.0, False), (MOST_C + 15.0, 1.0, False)],
)
def test_only_a_wire_that_is_not_transformed_is_colder_than_the_limit(wire_c, phase, excluded):
    judged = by_resistance()
    assert not judged.excludes_limit(HOTTEST_C)
    for n in range(10):
        judged.update(sample(wire_c, phase, n))
    assert judged.excludes_limit(HOTTEST_C) is excluded


def test_hot_wire_is_not_excluded_however_hot_its_heat_input_may_have_made_it():
    judged = by_resistance()
    for n in range(10):
        judged.update(sample(240.0, 1.0, n))
    assert judged.excludes_limit(hottest_c=140.0)
    assert not judged.excludes_limit(hottest_c=260.0)


@pytest.mark.parametrize(("wire_c", "phase"), [(80.0, 0.9), (100.0, 1.0), (95.0, 0.6), (130.0, 1.0)])
def test_resistance_bounds_temperature_and_phase_from_below(wire_c, phase):
    judged = by_resistance()
    assert judged.at_least() == UNBOUNDED
    for n in range(10):
        judged.update(sample(wire_c, phase, n))
    least = judged.at_least()
    assert 22.0 < least.temperature_c <= wire_c
    assert 0.0 < least.phase <= phase


def test_cold_wire_has_no_lower_bound():
    judged = by_resistance()
    for n in range(10):
        judged.update(sample(40.0, 0.0, n))
    assert judged.at_least() == UNBOUNDED


def test_sample_with_a_small_current_or_without_a_voltage_keeps_the_last_result():
    judged = by_resistance()
    for n in range(10):
        judged.update(sample(85.0, 0.2, n))
    for n in range(10, 60):
        judged.update(sample(MOST_C, 1.0, n, current_a=0.04))
        judged.update(sample(MOST_C, 1.0, n)._replace(voltage_v=nan))
    assert judged.excludes_limit(HOTTEST_C)
    for n in range(60, 70):
        judged.update(sample(MOST_C, 1.0, n))
    assert not judged.excludes_limit(HOTTEST_C)


def test_current_that_can_heat_the_wire_to_the_limit_is_large_enough_whatever_the_supply_can_give():
    judged = by_resistance(current_max_a=5.0)
    for n in range(10):
        judged.update(sample(85.0, 0.2, n))
    for n in range(10, 60):
        judged.update(sample(MOST_C, 1.0, n, current_a=0.2))
    assert not judged.excludes_limit(HOTTEST_C)


def test_resistance_belongs_to_a_right_reading_and_not_to_a_wrong_one():
    judged = by_resistance()
    assert judged.outside(30.0, nan) is None
    for n in range(10):
        judged.update(sample(100.0, 1.0, n))
    assert judged.outside(100.0, nan) is judged.outside(nan, nan) is None
    assert "Ω" in judged.outside(30.0, nan)


def trip(samples, judged):
    band = TemperatureBand(BALANCE, IDENTIFIED, 0.5)
    band.start(samples[0].temperature_c, samples[0].time_s)
    supervisor = Supervisor(LIMITS, band, DisplacementBand(MODEL), by_resistance=judged)
    for one in samples:
        if found := supervisor.update(one, nan):
            return found.fault
    return None


def test_draft_trips_only_if_the_resistance_does_not_show_a_cool_wire():
    in_a_draft = [sample(60.0, 0.0, n, current_a=0.36) for n in range(600)]
    assert trip(in_a_draft, None) is Fault.READS_TOO_COLD
    assert trip(in_a_draft, by_resistance()) is None


def test_reading_that_does_not_belong_to_the_resistance_trips():
    without_bead = [sample(95.0, 0.95, n, reading_c=40.0, current_a=0.2) for n in range(100)]
    assert trip(without_bead, None) is None
    assert trip(without_bead, by_resistance()) is Fault.RESISTANCE_IMPLAUSIBLE


def test_wire_that_cools_without_current_is_not_compared_with_its_hot_resistance():
    hot = [sample(110.0, 1.0, n, current_a=0.2) for n in range(20)]
    cooling_c = [22.0 + 88.0 * exp(-0.05 * n / BALANCE.time_constant_s) for n in range(300)]
    cooling = [sample(one_c, 0.0, 20 + n, current_a=0.03) for n, one_c in enumerate(cooling_c)]
    heated = [sample(22.0 + 3.0 * n, 0.0, 320 + n) for n in range(10)]
    assert trip(hot + cooling + heated, by_resistance()) is None


def test_reading_that_is_wrong_trips_although_the_current_pauses():
    samples = [sample(95.0, 0.95, n, reading_c=40.0, current_a=0.2 if n % 40 < 20 else 0.0) for n in range(200)]
    assert trip(samples, by_resistance()) is Fault.RESISTANCE_IMPLAUSIBLE


def test_resistance_that_is_not_used_judges_nothing_until_it_is_used():
    source = [DisplacementFrom.NONE]
    judged = by_resistance(lambda: source[0])
    for n in range(10):
        judged.update(sample(30.0, 0.0, n))
    assert not judged.excludes_limit(HOTTEST_C)
    assert judged.outside(110.0, nan) is None
    source[0] = DisplacementFrom.RESISTANCE
    assert judged.excludes_limit(HOTTEST_C)
    assert judged.outside(110.0, nan) is not None


def test_resistance_that_is_the_source_trips_although_a_sensor_agrees_with_the_thermocouple():
    other_wire = [sample(30.0, 0.0, n, reading_c=110.0, displacement_mm=12.0) for n in range(200)]
    assert trip(other_wire, by_resistance()) is None
    assert trip(other_wire, by_resistance(lambda: DisplacementFrom.RESISTANCE)) is Fault.RESISTANCE_IMPLAUSIBLE


def test_sensor_that_contradicts_trips_although_the_resistance_is_the_source():
    stuck = [sample(110.0, 1.0, n, displacement_mm=3.0) for n in range(200)]
    assert trip(stuck, by_resistance(lambda: DisplacementFrom.RESISTANCE)) is Fault.DISPLACEMENT_IMPLAUSIBLE


def test_displacement_sensor_that_works_comes_first():
    in_a_draft = [sample(60.0, 0.0, n, current_a=0.36, displacement_mm=12.0) for n in range(600)]
    assert trip(in_a_draft, by_resistance()) is Fault.READS_TOO_COLD
