"""The resistance fit: it finds a known resistance within its intervals, and says why it finds none."""

import dataclasses

import numpy as np
import pytest

from smadrive.errors import IdentificationError, ModelError
from smadrive.hysteresis import DuhemModel
from smadrive.identification.excitation import ExcitationRecord
from smadrive.identification.resistance_fit.fit import MOST_MISFIT, identify_resistance
from smadrive.wire.heat_balance import HeatBalance
from smadrive.wire.identified_resistance import WireResistance
from smadrive.wire.observability import resolution_error
from smadrive.wire.wire_model import WireModel

MODEL = DuhemModel.gaussian(
    mu_heating=90, mu_cooling=69, sigma_heating=5, sigma_cooling=5, scale=12, input_range=(20, 140)
)
WIRE = WireModel(MODEL, HeatBalance(0.029, 0.012, 0.83, 22.0, 16.5, -0.12, 0.15))
NODES = tuple(np.linspace(20.0, 130.0, 28).tolist())
HUMP = tuple(14.5 + 0.006 * (c - 70.0) + 0.4 / (1.0 + np.exp((c - 68.0) / 3.5)) for c in NODES)
TRUE = WireResistance(70.0, 17.0, 0.012, 0.04, 0.004, 0.0, 0.0, NODES, HUMP)
DT_S, NOISE_V = 0.05, 0.004


def record_of(true=TRUE, delay_s=0.0, noise_v=NOISE_V):
    turns = [25, 125, 30, 110, 45, 95, 55, 85, 60, 120, 40]
    times = np.concatenate(([0.0], np.cumsum(np.abs(np.diff(turns)) / 6.0)))
    time_s = np.arange(0.0, times[-1], DT_S)
    noise = np.random.default_rng(5)
    celsius, early_c = np.interp(time_s, times, turns), np.interp(time_s - delay_s, times, turns)
    displacement, early_mm = MODEL.simulate(celsius), MODEL.simulate(early_c)
    ohm = np.array([true.ohm(*place) for place in zip(early_c.tolist(), (early_mm / 12.0).tolist(), strict=True)])
    current = np.sqrt(np.maximum(0.012 * (celsius - 22.0), 0.02) / 16.0)
    voltage = current * ohm + noise.normal(0.0, noise_v, time_s.size)
    seen_mm = displacement + noise.normal(0.0, 0.012, time_s.size)
    return ExcitationRecord(time_s, current, voltage, celsius, seen_mm)


@pytest.fixture(scope="module")
def fitted():
    record = record_of(delay_s=0.05)
    return identify_resistance(record, record.temperature_c, WIRE)


def test_resistance_is_found_along_both_branches(fitted):
    for rising in (True, False):
        celsius = np.linspace(50.0, 115.0, 60)
        phase = MODEL.branch(celsius, rising=rising)
        for place in zip(celsius.tolist(), phase.tolist(), strict=True):
            assert fitted.resistance.ohm(*place) == pytest.approx(TRUE.ohm(*place), abs=0.02)


def test_intervals_contain_the_martensite(fitted):
    resistance = fitted.resistance
    at_reference = TRUE.martensite_ohm + TRUE.martensite_ohm_per_k * (resistance.reference_c - TRUE.reference_c)
    assert abs(resistance.martensite_ohm - at_reference) < 2.0 * fitted.within["martensite_ohm"]
    assert abs(resistance.martensite_ohm_per_k - 0.012) < 2.0 * fitted.within["martensite_ohm_per_k"]


def test_noise_and_delay_are_found(fitted):
    assert fitted.resistance.noise_v == pytest.approx(NOISE_V, rel=0.1)
    assert fitted.resistance.delay_s == pytest.approx(0.05, abs=0.01)


@pytest.mark.parametrize("quantum", [0.001, 0.01])
def test_resolution_of_the_meters_is_found(quantum):
    record = record_of()
    current_a, voltage_v = (quantum * np.round(column / quantum) for column in (record.current_a, record.voltage_v))
    read = dataclasses.replace(record, current_a=current_a, voltage_v=voltage_v)
    fit = identify_resistance(read, record.temperature_c, WIRE)
    assert fit.resolution == pytest.approx(resolution_error(WIRE, fit.resistance, quantum, quantum))


def test_fine_meters_have_no_resolution(fitted):
    assert fitted.resolution == 0.0


def test_samples_with_a_changing_current_are_left_out():
    record = record_of()
    spoilt = record.voltage_v.copy()
    spoilt[::40] *= 1.3
    spoilt_record = dataclasses.replace(record, voltage_v=spoilt)
    fit = identify_resistance(spoilt_record, record.temperature_c, WIRE)
    assert fit.resistance.ohm(80.0, 0.5) == pytest.approx(TRUE.ohm(80.0, 0.5), abs=0.012)


@pytest.mark.parametrize("name", ["current_a", "voltage_v"])
def test_record_without_current_or_voltage(name):
    record = record_of()
    silent = dataclasses.replace(record, **{name: np.zeros(record.time_s.size)})
    with pytest.raises(IdentificationError) as raised:
        identify_resistance(silent, record.temperature_c, WIRE)
    assert raised.value.where == "resistance fit"
    assert raised.value.cure


@pytest.mark.parametrize("noise_v", [NOISE_V, 0.2])
def test_resistance_that_says_too_little(noise_v):
    constant = dataclasses.replace(TRUE, strain=0.0, martensite_ohm_per_k=0.0, austenite_ohm=(17.0,) * len(NODES))
    record = record_of(constant if noise_v == NOISE_V else TRUE, noise_v=noise_v)
    with pytest.raises(IdentificationError) as raised:
        identify_resistance(record, record.temperature_c, WIRE)
    assert raised.value.limit


def test_resistance_that_no_wire_has_is_not_identified():
    """The supply averages over 3 s, so current and voltage are those of an earlier wire."""
    record = record_of(delay_s=1.5)
    with pytest.raises(IdentificationError) as raised:
        identify_resistance(record, record.temperature_c, WIRE)
    assert isinstance(raised.value.__cause__, ModelError)


def test_resistance_of_another_time_is_not_identified():
    record = record_of(delay_s=1.35)
    with pytest.raises(IdentificationError) as raised:
        identify_resistance(record, record.temperature_c, WIRE)
    assert raised.value.limit == f"{100 * MOST_MISFIT:g} %"
