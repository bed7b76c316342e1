"""The thermal fit recovers the parameters of a known wire, and rejects a record that does not determine them."""

import dataclasses
import re

import numpy as np
import pytest

from smadrive.errors import ConfigError, IdentificationError
from smadrive.hysteresis import DuhemModel
from smadrive.identification.excitation import ExcitationRecord, check_may_excite
from smadrive.identification.excitation_plans import planned_excitation
from smadrive.identification.thermal_fit.fit import FIT, identify_thermal
from smadrive.measurement import Measurement
from smadrive.wire.heat_balance import HeatBalance

TRUE = HeatBalance(0.029, 0.012, 0.83, 22.0, 16.5, -0.12, 0.15)
NOMINAL = HeatBalance(0.035, 0.0145, 0.70, 20.0, 15.0, 0.0, 0.08)
LOOP = DuhemModel.gaussian(
    mu_heating=90, mu_cooling=69, sigma_heating=5, sigma_cooling=5, scale=12, input_range=(0, 160)
)
DT_S = 0.05


@pytest.fixture(scope="module")
def record():
    """A wire driven by power steps, simulated in fine steps, with 0.1 K and 0.1 % sensor noise."""
    noise = np.random.default_rng(1)
    wire = reading = 22.0
    state = LOOP.initial_state(wire)
    columns = []
    for n in range(6000):
        current_a = 0.32 if (n // 300) % 2 == 0 else (0.1, 0.2)[(n // 600) % 2]
        resistance = TRUE.resistance_ohm(state.w)
        for _ in range(10):
            direction = 1 if TRUE.ambient_c + current_a**2 * resistance / TRUE.loss_w_per_k > wire else -1
            slope = LOOP.slope(state, direction) / LOOP.scale
            after = TRUE.step(wire, current_a**2 * resistance, slope, DT_S / 10)
            reading = TRUE.step_thermocouple(reading, wire, after, DT_S / 10)
            wire, state = after, LOOP.step(state, after)
        columns.append(((n + 1) * DT_S, current_a, current_a * resistance, reading, state.y, wire))
    time, current, voltage, temperature, displacement, truth = np.array(columns).T
    noisy = ExcitationRecord(
        time,
        current,
        voltage,
        temperature + noise.normal(0, 0.1, time.size),
        displacement + noise.normal(0, 0.012, time.size),
    )
    return noisy, truth


def test_parameters_of_a_known_wire_are_recovered(record):
    measured, _ = record
    found = identify_thermal(measured, NOMINAL).balance
    for name, tolerance in (
        ("heat_capacity_j_per_k", 0.02),
        ("loss_w_per_k", 0.01),
        ("latent_heat_j", 0.03),
        ("resistance_cold_ohm", 0.01),
        ("resistance_change", 0.05),
        ("thermocouple_lag_s", 0.10),
    ):
        assert getattr(found, name) == pytest.approx(getattr(TRUE, name), rel=tolerance), name
    assert found.ambient_c == pytest.approx(TRUE.ambient_c, abs=0.3)


def test_true_parameters_are_near_the_intervals(record):
    measured, _ = record
    fit = identify_thermal(measured, NOMINAL)
    for name, half in fit.within.items():
        scale = 1.0 if name in {"ambient_c", "resistance_change"} else getattr(TRUE, name)
        assert abs(getattr(fit.balance, name) - getattr(TRUE, name)) < 3.0 * half * scale, name
    assert fit.within["heat_capacity_j_per_k"] < 0.02
    assert fit.within["latent_heat_j"] < 0.05


def test_record_that_determines_a_parameter_poorly_is_rejected_with_its_interval(record):
    measured, _ = record
    noise = np.random.default_rng(4).normal(0, 25.0, measured.time_s.size)
    hinting = dataclasses.replace(measured, temperature_c=measured.temperature_c + noise)
    with pytest.raises(IdentificationError) as error:
        identify_thermal(hinting, NOMINAL)
    assert re.fullmatch(r"±[\d.]+ %", error.value.value)
    assert re.fullmatch(r"±\d+ %", error.value.limit)
    assert error.value.cure.startswith("excite for longer")


def test_wire_temperature_is_free_of_lag_and_noise(record):
    measured, truth = record
    estimated = identify_thermal(measured, NOMINAL).wire_temperature_c
    error = (estimated - truth)[200:]
    assert np.sqrt(np.mean(error**2)) < 0.1
    assert np.sqrt(np.mean((measured.temperature_c - truth)[200:] ** 2)) > 0.5  # what it would be without the fit


def test_noise_of_the_thermocouple_is_found(record):
    measured, _ = record
    assert identify_thermal(measured, NOMINAL).balance.thermocouple_noise_c == pytest.approx(0.1, rel=0.1)


def test_leads_hardly_change_the_wire_temperature(record):
    """The voltage of two-wire sensing includes the leads, so the power is wrong, and differently in each phase."""
    measured, truth = record
    leads = dataclasses.replace(measured, voltage_v=measured.voltage_v + 0.05 * 16.5 * measured.current_a)
    error_c = (identify_thermal(leads, NOMINAL).wire_temperature_c - truth)[200:-20]
    slow_c = np.convolve(error_c, np.full(20, 1 / 20), mode="valid")  # over 1 s: the noise of the sensors averages out
    assert np.sqrt(np.mean(slow_c**2)) < 0.04


def test_spikes_of_the_thermocouple_hardly_change_the_wire_temperature(record):
    measured, truth = record
    spiked_c = measured.temperature_c.copy()
    spiked_c[100::200] += 30.0
    error_c = (
        identify_thermal(dataclasses.replace(measured, temperature_c=spiked_c), NOMINAL).wire_temperature_c - truth
    )
    assert np.sqrt(np.mean(error_c[200:] ** 2)) < 0.1


def test_noisy_thermocouple_is_followed_slowly(record):
    measured, truth = record
    noise_c = np.random.default_rng(6).normal(0.0, 1.0, truth.size)
    noisy = dataclasses.replace(measured, temperature_c=measured.temperature_c + noise_c)
    error_c = (identify_thermal(noisy, NOMINAL).wire_temperature_c - truth)[200:-20]
    assert np.sqrt(np.mean(error_c**2)) < 0.1


def test_jitter_of_the_clock_does_not_change_the_fit(record):
    measured, _ = record
    jitter = np.random.default_rng(5).uniform(-0.4, 0.4, measured.time_s.size) * DT_S
    times = measured.time_s + jitter
    resampled = {
        name: np.interp(times, measured.time_s, getattr(measured, name))
        for name in ("temperature_c", "displacement_mm")
    }
    energy = np.cumsum(measured.current_a * measured.voltage_v) * DT_S
    power = np.diff(np.interp(times, measured.time_s, energy), prepend=0.0) / np.diff(times, prepend=times[0] - DT_S)
    jittered = ExcitationRecord(times, measured.current_a, power / np.maximum(measured.current_a, 1e-9), **resampled)
    even = identify_thermal(measured, NOMINAL).balance
    found = identify_thermal(jittered, NOMINAL).balance
    assert found.thermocouple_lag_s == pytest.approx(even.thermocouple_lag_s, abs=0.01)
    assert found.heat_capacity_j_per_k == pytest.approx(even.heat_capacity_j_per_k, rel=0.01)


def test_sensor_that_falls_on_heating_gives_the_same_wire(record):
    measured, _ = record
    mirrored = dataclasses.replace(measured, displacement_mm=12.0 - measured.displacement_mm)
    found = identify_thermal(mirrored, NOMINAL).balance
    assert found.latent_heat_j == pytest.approx(identify_thermal(measured, NOMINAL).balance.latent_heat_j, rel=1e-3)


@pytest.mark.parametrize(
    ("change", "what", "value"),
    [
        ({"current_a": 0.0}, "current", None),
        ({"displacement_mm": 3.0}, "did not move", "displacement span 0 mm"),
        (
            {"displacement_mm": np.random.default_rng(0).normal(3.0, 0.012, 6000)},
            "did not move",
            "displacement span 0.061 mm",
        ),
        ({"time_s": 0.0}, "time_s", None),
    ],
)
def test_unsuitable_record_is_rejected_with_the_reason(record, change, what, value):
    measured, _ = record
    columns = {name: np.full(measured.time_s.size, value) for name, value in change.items()}
    with pytest.raises(IdentificationError) as error:
        identify_thermal(dataclasses.replace(measured, **columns), NOMINAL)
    assert error.value.where == FIT
    assert what in error.value.what
    assert error.value.value == value


def test_wire_far_from_the_nominal_one_is_rejected(record):
    measured, _ = record
    far = dataclasses.replace(NOMINAL, heat_capacity_j_per_k=0.035 * 12)
    with pytest.raises(IdentificationError) as error:
        identify_thermal(measured, far)
    assert error.value.where == FIT
    assert "heat capacity" in error.value.what


def test_excitation_reverses_at_many_depths_and_ends_cold():
    excitation = planned_excitation("nested", 40.0, 120.0, 4.0, start_c=22.0)
    points = np.array(excitation.turning_points_c)
    assert points[0] == 22.0
    assert points[-1] == 40.0
    inner = points[(points > 40.0) & (points < 120.0)]
    assert len(set(np.round(inner, 6))) >= 10
    assert np.all(np.diff(excitation.times_s) > 0)
    rates = np.diff(points) / np.diff(excitation.times_s)
    np.testing.assert_allclose(np.abs(rates), 4.0)
    assert excitation.temperature_c(excitation.duration_s + 5) == 40.0


def test_excitation_without_range_is_rejected():
    with pytest.raises(ConfigError) as error:
        planned_excitation("nested", 90.0, 60.0, 4.0, start_c=22.0)
    assert (error.value.where, error.value.value, error.value.limit) == ("excitation.high_c", 60.0, 90.0)
    with pytest.raises(ConfigError) as error:
        planned_excitation("nested", 60.0, 90.0, 0.0, start_c=22.0)
    assert error.value.where == "excitation.rate_c_per_s"


def from_low(low_c):
    return planned_excitation("nested", low_c, 120.0, 6.0, start_c=22.0)


EXCITATION = from_low(40.0)
FOUND = Measurement(0.0, 22.0, 0.0, 0.0, displacement_mm=0.0)


def test_possible_experiment_is_accepted():
    check_may_excite(EXCITATION, TRUE, 0.6, FOUND)


@pytest.mark.parametrize(
    ("excitation", "current_max_a", "found", "value", "limit", "cure"),
    [
        (EXCITATION, 0.6, FOUND._replace(displacement_mm=float("nan")), "None", "None", "connect a sensor"),
        (EXCITATION, 0.3, FOUND, r"about 0.3\d A", "0.3 A", "lower high_c or rate_c_per_s, or raise current_max_a if"),
        (from_low(30.0), 0.6, FOUND, "6 K/s", "2.* K/s", "raise low_c to 39"),
        (from_low(20.0), 0.6, FOUND, "6 K/s", ".* K/s", "raise low_c to 39"),
    ],
)
def test_impossible_experiment_is_rejected_with_the_cure(excitation, current_max_a, found, value, limit, cure):
    with pytest.raises(ConfigError) as error:
        check_may_excite(excitation, TRUE, current_max_a, found)
    assert re.fullmatch(value, str(error.value.value))
    assert re.fullmatch(limit, str(error.value.limit))
    assert error.value.cure.startswith(cure)
