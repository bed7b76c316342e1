"""The supervisor: raises each fault for its cause, only after its debounce, and latches the first."""

from dataclasses import replace
from math import exp, inf, nan

import pytest

from smadrive.errors import SafetyError
from smadrive.hysteresis import DuhemModel
from smadrive.measurement import Measurement
from smadrive.safety.displacement_band import DisplacementBand
from smadrive.safety.faults import CLEAR, Fault
from smadrive.safety.supervisor import Supervisor
from smadrive.safety.temperature_band import IDENTIFIED, TemperatureBand
from smadrive.wire.heat_balance import HeatBalance
from tests.unit.safety.limits import LIMITS


def sample(n=0, temperature_c=60.0, current_a=0.2, in_force_a=0.2, armed=True, **rest):
    return Measurement(0.05 * n, temperature_c, current_a, 3.3, in_force_a=in_force_a, armed=armed, **rest)


def trips_after(samples, limits=LIMITS, setpoint_mm=nan, band=None):
    """Return the number of samples until the trip, and its fault; None without a trip."""
    supervisor = Supervisor(limits, displacement_band=band)
    for n, one in enumerate(samples, start=1):
        if trip := supervisor.update(one, setpoint_mm):
            return n, trip.fault
    return None


def test_healthy_wire_never_trips():
    assert trips_after([sample(n) for n in range(1000)]) is None


def test_over_temperature_needs_two_of_three():
    assert trips_after([sample(temperature_c=125.0), sample(), sample(), sample(temperature_c=125.0), sample()]) is None
    assert trips_after([sample(temperature_c=125.0), sample(), sample(temperature_c=125.0)]) == (
        3,
        Fault.OVER_TEMPERATURE,
    )


def test_invalid_thermocouple_needs_three_of_five():
    bad = sample(temperature_c=nan, temperature_fault="thermocouple_open")
    assert trips_after([bad, bad, sample(), sample(), sample(), sample(), bad]) is None
    assert trips_after([bad, bad, sample(), bad]) == (4, Fault.SENSOR_INVALID)


def test_current_must_be_the_commanded_one():
    assert trips_after([sample(current_a=0.1)] * 10) == (4, Fault.CURRENT_MISMATCH)
    assert trips_after([sample(current_a=0.1, in_force_a=0.0)] * 10) == (4, Fault.UNEXPECTED_HEATING)


@pytest.mark.parametrize("unknown", [{"current_a": nan}, {"voltage_v": nan}, {"voltage_v": inf}])
def test_unknown_power_needs_three_of_five(unknown):
    bad = sample()._replace(**unknown)
    assert trips_after([bad, bad, sample(), sample(), sample(), sample(), bad]) is None
    assert trips_after([bad, bad, sample(), bad]) == (4, Fault.POWER_UNKNOWN)


def test_sample_of_unknown_power_keeps_the_previous_power():
    """The wire is heated hard, the bead has fallen off, and every other sample has no voltage."""
    balance = HeatBalance(0.0298, 0.014, 0.83, 22.0, 16.5, -0.12, 0.15)
    tripped = []
    for lacking in (False, True):
        supervisor = Supervisor(LIMITS, TemperatureBand(balance, IDENTIFIED, 0.5))
        for n in range(400):
            one = sample(n, temperature_c=22.0, current_a=0.5, in_force_a=0.5)._replace(voltage_v=8.0)
            if lacking and n % 3 == 2:
                one = one._replace(voltage_v=nan)
            if trip := supervisor.update(one, nan):
                tripped.append((trip.fault, n))
                break
    (first, n), (second, other) = tripped
    assert first is second
    assert abs(n - other) <= 2


@pytest.mark.parametrize("limit", [{"displacement_max_mm": 10.0}, {"tracking_max_mm": 1.0}])
def test_lost_displacement_with_a_limit_trips(limit):
    limits = replace(LIMITS, tracking_for_s=2.0, **limit)
    seen, lost = [sample(n, displacement_mm=5.0) for n in range(10)], [sample(n) for n in range(10, 100)]
    assert trips_after(seen + lost, limits, setpoint_mm=5.0) == (51, Fault.DISPLACEMENT_UNKNOWN)
    assert trips_after(seen + lost[:30] + [sample(40, displacement_mm=5.0)], limits, setpoint_mm=5.0) is None
    assert trips_after(lost, limits, setpoint_mm=5.0) == (42, Fault.DISPLACEMENT_UNKNOWN)
    assert trips_after(seen + lost) is None


@pytest.mark.parametrize("name", ["displacement_min_mm", "displacement_max_mm", "tracking_max_mm"])
def test_unknown_displacement_with_a_limit_prevents_arming(name):
    rest = {"current_a": 0.0, "in_force_a": 0.0}
    Supervisor(LIMITS).check_may_arm(sample(**rest))
    limited = Supervisor(replace(LIMITS, **{name: 5.0}))
    limited.check_may_arm(sample(displacement_mm=5.0, **rest))
    with pytest.raises(SafetyError) as refused:
        limited.check_may_arm(sample(**rest))
    assert Fault.DISPLACEMENT_UNKNOWN.remedy in refused.value.cure


def test_unknown_current_prevents_arming():
    with pytest.raises(SafetyError):
        Supervisor(LIMITS).check_may_arm(sample(current_a=nan, in_force_a=0.0))


def test_current_below_the_command_at_a_reported_limit_is_no_mismatch():
    assert trips_after([sample(current_a=0.1, device_limits=("temperature",))] * 10) is None
    assert trips_after([sample(current_a=0.4, device_limits=("temperature",))] * 10) == (4, Fault.CURRENT_MISMATCH)


def test_fault_of_the_device_trips_at_once():
    assert trips_after([sample(device_faults=("watchdog",))]) == (1, Fault.DEVICE_FAULT)


def test_silence_is_a_fault_after_its_limit():
    supervisor = Supervisor(LIMITS)
    supervisor.update(sample(0), nan)
    assert supervisor.check_fresh(0.29) is None
    trip = supervisor.check_fresh(0.31)
    assert trip is not None
    assert trip.fault is Fault.STALE_DATA
    assert "rate_hz or a larger stale_after_s" in str(trip)


def test_silence_is_a_fault_even_if_a_late_measurement_ends_it():
    assert trips_after([sample(0), sample(5), sample(12)]) == (3, Fault.STALE_DATA)


def test_silence_from_the_beginning_counts_too():
    supervisor = Supervisor(LIMITS)
    assert supervisor.check_fresh(10.0) is None
    assert supervisor.check_fresh(10.4) is not None


def test_first_fault_is_latched():
    supervisor = Supervisor(LIMITS)
    supervisor.update(sample(device_faults=("watchdog",)), nan)
    for n in range(10):
        trip = supervisor.update(sample(n, temperature_c=200.0), nan)
    assert trip is not None
    assert trip.fault is Fault.DEVICE_FAULT


def test_trip_text_has_number_cause_value_limit_and_remedy():
    supervisor = Supervisor(LIMITS)
    for n in range(2):
        trip = supervisor.update(sample(n, temperature_c=125.04), nan)
    text = str(trip)
    for part in ("fault 1", "hotter", "125.0 °C", "120", "let it cool"):
        assert part in text


@pytest.mark.parametrize(
    ("fields", "value", "limit"),
    [
        ({"temperature_c": 125.04}, "125.0 °C", "120 °C"),
        ({"temperature_c": -30.0}, "-30.0 °C", "-20 °C"),
        ({"displacement_mm": 13.5}, "13.500 mm", "12 mm"),
        ({"displacement_mm": -1.5}, "-1.500 mm", "-1 mm"),
        ({"device_faults": ("over_temperature",), "temperature_c": 119.9}, "119.9 °C", "temperature_max_c = 120 °C"),
        ({"device_faults": ("over_current",), "current_a": 0.62}, "0.620 A", "current_max_a = 0.6 A"),
        ({"device_faults": ("watchdog",)}, "watchdog", None),
        ({"current_a": 0.31}, "0.310 A", "± 0.05 A"),
    ],
)
def test_error_of_a_trip_has_value_limit_and_the_cure_that_clears_it(fields, value, limit):
    supervisor = Supervisor(replace(LIMITS, current_max_a=0.6, displacement_min_mm=-1.0, displacement_max_mm=12.0))
    while (trip := supervisor.update(sample()._replace(**fields), nan)) is None:
        pass
    error = trip.error()
    assert value in error.value
    assert (error.number, error.limit, error.cure) == (trip.fault.number, limit, CLEAR)
    assert all(str(error).count(part) == 1 for part in (error.what[:-1], CLEAR, limit or value))


def test_fault_numbers_are_unique():
    numbers = [fault.number for fault in Fault]
    assert len(set(numbers)) == len(numbers)


@pytest.mark.parametrize(
    ("measurement", "value", "limit", "cure"),
    [
        (sample(device_faults=("watchdog",)), None, None, CLEAR),
        (
            sample(temperature_c=nan, temperature_fault="thermocouple_open"),
            "thermocouple_open",
            None,
            Fault.SENSOR_INVALID.remedy,
        ),
        (sample(temperature_c=130.0), "130.0 °C", "temperature_max_c = 120 °C", Fault.OVER_TEMPERATURE.remedy),
    ],
)
def test_arming_is_rejected_with_the_cure(measurement, value, limit, cure):
    with pytest.raises(SafetyError) as error:
        Supervisor(LIMITS).check_may_arm(measurement)
    assert (error.value.value, error.value.limit, error.value.cure) == (value, limit, cure)


def test_device_that_stops_heating_by_itself_trips():
    assert trips_after([sample(), sample(armed=False), sample(armed=False)]) == (3, Fault.DISARMED)


def test_temperature_below_its_minimum_trips():
    assert trips_after([sample(temperature_c=-25.0)] * 5) == (3, Fault.UNDER_TEMPERATURE)


def test_current_of_a_slow_source_may_lie_between_its_last_commands():
    slow = replace(LIMITS, settle_s=0.5)
    ramp = [sample(n, current_a=0.02 * n, in_force_a=0.02 * (n + 8)) for n in range(100)]
    assert trips_after(ramp) == (4, Fault.CURRENT_MISMATCH)
    assert trips_after(ramp, slow) is None
    stuck = [sample(n, current_a=0.5, in_force_a=0.5 if n < 10 else 0.1) for n in range(100)]
    count, fault = trips_after(stuck, slow)
    assert fault is Fault.CURRENT_MISMATCH
    assert 20 <= count <= 25


def test_voltage_limit_explains_less_current_but_not_a_broken_wire():
    at_limit = {"device_limits": ("voltage",), "in_force_a": 0.4}
    assert trips_after([sample(current_a=0.3, **at_limit)] * 10) is None
    assert trips_after([sample(current_a=0.0, **at_limit)] * 10) == (4, Fault.CURRENT_MISMATCH)


def test_displacement_has_its_own_limits():
    between = replace(LIMITS, displacement_min_mm=-1.0, displacement_max_mm=12.0)
    assert trips_after([sample(displacement_mm=11.9)] * 10, between) is None
    assert trips_after([sample(displacement_mm=12.1)] * 10, between) == (3, Fault.OVER_DISPLACEMENT)
    assert trips_after([sample(displacement_mm=nan)] * 10, between) is None


def test_wire_that_does_not_follow_for_too_long_trips():
    tracking = replace(LIMITS, tracking_max_mm=1.0, tracking_for_s=2.0)
    strayed = [sample(n, displacement_mm=3.5) for n in range(100)]
    back = [sample(n, displacement_mm=3.5 if n % 30 else 4.5) for n in range(100)]
    assert trips_after(strayed, tracking, setpoint_mm=5.0) == (42, Fault.TRACKING_LOST)
    assert trips_after(back, tracking, setpoint_mm=5.0) is None
    assert trips_after(strayed, tracking) is None


@pytest.mark.parametrize("missing", [1, 2])
@pytest.mark.parametrize(
    ("shown_mm", "setpoint_mm", "fault"), [(7.0, nan, Fault.OVER_DISPLACEMENT), (4.0, 5.9, Fault.TRACKING_LOST)]
)
def test_displacement_that_is_read_only_now_and_then_is_checked(missing, shown_mm, setpoint_mm, fault):
    limits = replace(LIMITS, displacement_max_mm=6.0, tracking_max_mm=1.0, tracking_for_s=0.5)
    samples = [sample(n, displacement_mm=nan if n % (missing + 1) else shown_mm) for n in range(100)]
    assert trips_after(samples, limits, setpoint_mm)[1] is fault


def test_current_that_is_read_only_now_and_then_is_checked():
    samples = [sample(n, current_a=nan if n % 5 in (1, 3) else 0.1) for n in range(20)]
    assert trips_after(samples)[1] is Fault.CURRENT_MISMATCH


def test_loop_that_is_always_late_trips():
    supervisor = Supervisor(LIMITS)
    assert all(supervisor.check_deadline(n % 15 > 0, 0.05 * n) is None for n in range(1000))
    trips = [supervisor.check_deadline(True, 0.05 * n) for n in range(20)]
    assert trips[-1].fault is Fault.DEADLINES_MISSED


@pytest.mark.parametrize("current_a", [0.3, -0.3])
def test_arming_is_rejected_while_current_flows(current_a):
    with pytest.raises(SafetyError) as error:
        Supervisor(LIMITS).check_may_arm(sample(current_a=current_a, in_force_a=0.0))
    assert (error.value.value, error.value.cure) == (f"{current_a:.3f} A", Fault.UNEXPECTED_HEATING.remedy)


@pytest.fixture
def band():
    """The band of a wire that rises by 12 mm at 90 °C and falls at 69 °C."""
    model = DuhemModel.gaussian(
        mu_heating=90.0, mu_cooling=69.0, sigma_heating=5.0, sigma_cooling=5.0, scale=12.0, input_range=(20.0, 140.0)
    )
    return DisplacementBand(model)


@pytest.mark.parametrize(("temperature_c", "displacement_mm"), [(115.0, 0.0), (30.0, 12.0)])
def test_displacement_outside_the_band_trips_after_the_lag_of_the_thermocouple(band, temperature_c, displacement_mm):
    samples = [sample(n, temperature_c=temperature_c, displacement_mm=displacement_mm) for n in range(100)]
    after, fault = trips_after(samples, band=band)
    assert fault is Fault.DISPLACEMENT_IMPLAUSIBLE
    assert 0.05 * after == pytest.approx(LIMITS.contradicts_for_s, abs=0.2)


@pytest.mark.parametrize("displacement_mm", [-2.0, 999.0])
def test_displacement_beyond_the_travel_trips_at_once(band, displacement_mm):
    samples = [sample(n, temperature_c=80.0, displacement_mm=displacement_mm) for n in range(100)]
    assert trips_after(samples, band=band) == (3, Fault.DISPLACEMENT_IMPLAUSIBLE)


@pytest.mark.parametrize("missing", [1, 2])
def test_displacement_beyond_the_travel_that_is_read_only_now_and_then_trips_at_the_third_reading(band, missing):
    shown_mm = [nan if n % (missing + 1) else 999.0 for n in range(20)]
    samples = [sample(n, temperature_c=80.0, displacement_mm=each_mm) for n, each_mm in enumerate(shown_mm)]
    assert trips_after(samples, band=band) == (1 + 2 * (missing + 1), Fault.DISPLACEMENT_IMPLAUSIBLE)


def test_displacement_outside_the_band_for_a_short_time_or_not_measured_does_not_trip(band):
    there = [sample(n, temperature_c=115.0, displacement_mm=0.0 if n % 50 else 12.0) for n in range(500)]
    assert trips_after(there, band=band) is None
    assert trips_after([sample(n, temperature_c=115.0) for n in range(500)], band=band) is None


def test_contradiction_lasts_through_samples_without_a_reading(band):
    samples = [sample(n, temperature_c=nan if n % 5 == 0 else 115.0, displacement_mm=0.0) for n in range(200)]
    assert trips_after(samples, band=band)[1] is Fault.DISPLACEMENT_IMPLAUSIBLE


def test_sensor_without_its_zero_prevents_arming(band):
    rest = {"current_a": 0.0, "in_force_a": 0.0, "temperature_c": 22.0}
    Supervisor(LIMITS, displacement_band=band).check_may_arm(sample(displacement_mm=0.5, **rest))
    with pytest.raises(SafetyError) as error:
        Supervisor(LIMITS, displacement_band=band).check_may_arm(sample(displacement_mm=6.0, **rest))
    assert error.value.cure == Fault.DISPLACEMENT_IMPLAUSIBLE.remedy


def in_a_draft(displacement_mm, temperature_c=80.0, missing=(), age_s=0.0, **options):
    """Return the fault of a wire that is held at 80 °C in a draft of 2.5 times the identified convection.

    The displacement is `missing` in the samples of these numbers, and `age_s` old in the others.
    """
    balance = HeatBalance(0.029, 0.012, 0.83, 22.0, 16.5, -0.12, 0.15)
    model = DuhemModel.gaussian(
        mu_heating=90, mu_cooling=69, sigma_heating=5, sigma_cooling=5, scale=12, input_range=(20, 140)
    )
    supervisor = Supervisor(LIMITS, TemperatureBand(balance, IDENTIFIED, 0.5), DisplacementBand(model), **options)
    supervisor.check_may_arm(sample(temperature_c=22.0, current_a=0.0, in_force_a=0.0, displacement_mm=0.0))
    current_a = 2.5 * 0.012 * 58.0 / 3.3
    for n in range(400):
        reading_c = min(22.0 + n, temperature_c + 0.01 * (n % 2))
        shown_mm = nan if n in missing else displacement_mm if n > 40 else 0.0
        one = sample(n, reading_c, current_a, current_a, displacement_mm=shown_mm, displacement_age_s=age_s)
        if trip := supervisor.update(one, nan):
            return trip.fault
    return None


def test_hot_wire_that_cools_while_a_slow_supply_is_armed_does_not_trip():
    balance = HeatBalance(0.029, 0.012, 0.83, 22.0, 16.5, -0.12, 0.15)
    supervisor = Supervisor(LIMITS, TemperatureBand(balance, IDENTIFIED, 0.15))
    cold = {"current_a": 0.0, "in_force_a": 0.0}
    supervisor.check_may_arm(sample(0, 100.0, **cold))
    for n in range(40, 200):
        time_s = 0.05 * n
        assert supervisor.update(sample(n, 22.0 + 78.0 * exp(-time_s * 0.012 / 0.029), **cold), nan) is None


def test_displacement_proves_that_a_wire_in_a_draft_is_not_too_hot():
    assert in_a_draft(6.0) is None
    assert in_a_draft(nan) is Fault.READS_TOO_COLD


def test_missing_displacement_neither_confirms_nor_ends_a_fault_by_the_heat_input():
    assert in_a_draft(6.0, missing={200}) is None


@pytest.mark.parametrize(("share", "fault"), [(0.9, None), (1.1, Fault.READS_TOO_COLD), (nan, Fault.READS_TOO_COLD)])
def test_old_displacement_proves_nothing(share, fault):
    assert in_a_draft(6.0, age_s=share * LIMITS.displacement_fresh_s) is fault


def test_old_displacement_contradicts_no_reading_but_has_limits(band):
    aged = {"temperature_c": 115.0, "displacement_mm": 0.0, "displacement_age_s": 2.0 * LIMITS.displacement_fresh_s}
    samples = [sample(n, **aged) for n in range(200)]
    assert trips_after(samples, band=band) is None
    limits = replace(LIMITS, displacement_min_mm=1.0)
    assert trips_after(samples, limits, band=band) == (3, Fault.OVER_DISPLACEMENT)


def test_old_displacement_does_not_excuse_a_cold_reading_after_a_run(band):
    balance = HeatBalance(0.029, 0.012, 0.83, 22.0, 16.5, -0.12, 0.15)
    hot = TemperatureBand(balance, IDENTIFIED, 0.5)
    hot.start(22.0, 0.0)
    for n in range(1, 100):
        hot.update(22.0, 2.0, 0.05 * n)
    off = {"temperature_c": 22.0, "current_a": 0.0, "in_force_a": 0.0, "displacement_mm": 0.0}
    again = [Supervisor(LIMITS, TemperatureBand(balance, IDENTIFIED, 0.5, hot.heated), band) for _ in range(2)]
    again[0].check_may_arm(sample(100, **off))
    with pytest.raises(SafetyError):
        again[1].check_may_arm(sample(100, **off, displacement_age_s=2.0 * LIMITS.displacement_fresh_s))


def test_displacement_of_a_sensor_that_is_not_trusted_counts_as_not_measured(band):
    assert in_a_draft(6.0, trusts_sensor=lambda: False) is Fault.READS_TOO_COLD
    supervisor = Supervisor(LIMITS, displacement_band=band, trusts_sensor=lambda: False)
    assert not any(supervisor.update(sample(n, temperature_c=80.0, displacement_mm=999.0), nan) for n in range(100))


def test_displacement_of_a_wire_that_may_be_too_hot_proves_nothing():
    assert in_a_draft(11.8, 84.0) is Fault.READS_TOO_COLD
