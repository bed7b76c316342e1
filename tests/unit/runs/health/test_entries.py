"""Cycles and resistance at rest of a run, from its samples."""

import json
from math import isnan

import numpy as np
import pytest

from smadrive.hysteresis import DuhemModel
from smadrive.runs.health.entries import cycles_of_path, identification_entry, key_of, loop_shape
from smadrive.runs.health.rest_resistance import HeatedSamples, RestResistance, rest_resistance
from smadrive.wire.heat_balance import HeatBalance
from smadrive.wire.identified_wire import IdentifiedWire, load_wire, parse_wire
from smadrive.wire.wire_model import WireModel

MODEL = DuhemModel.gaussian(
    mu_heating=90, mu_cooling=69, sigma_heating=5, sigma_cooling=5, scale=12.0, input_range=(20, 140)
)
BALANCE = HeatBalance(0.03, 0.014, 0.8, 22.0, 16.5, -0.12, 0.15)
WIRE = WireModel(MODEL, BALANCE)
TIME_S = np.arange(0.0, 60.0, 0.05)


def swing(low_mm, high_mm, cycles):
    return low_mm + (high_mm - low_mm) * 0.5 * (1.0 - np.cos(2.0 * np.pi * cycles * TIME_S / TIME_S[-1]))


@pytest.mark.parametrize(
    ("path_mm", "cycles"),
    [
        (swing(2.0, 9.0, 3), 3.0),
        (swing(0.0, 12.0, 0.5), 0.5),
        (swing(5.0, 5.5, 4), 0.0),
        (np.where(TIME_S < 30.0, np.nan, swing(2.0, 9.0, 4)), 2.0),
        (np.full(3, np.nan), 0.0),
        (np.array([1.0]), 0.0),
    ],
)
def test_cycles_are_counted_from_the_displacement(path_mm, cycles):
    assert cycles_of_path(path_mm, 12.0) == cycles


def test_noise_makes_no_cycles():
    noise_mm = 0.05 * np.random.default_rng(1).standard_normal(TIME_S.size)
    assert cycles_of_path(swing(2.0, 9.0, 3) + noise_mm, 12.0) == 3.0


def heated(ohm, random=None):
    """Samples of a swing with the resistances `ohm` (samples,), and the noise of a board."""
    noise = np.zeros((2, TIME_S.size)) if random is None else random.standard_normal((2, TIME_S.size))
    current_a = 0.25 + 0.0002 * noise[0]
    temperature_c = np.full(TIME_S.size, 80.0)
    return HeatedSamples(TIME_S, current_a, 0.25 * ohm + 0.002 * noise[1], swing(2.0, 9.0, 3), temperature_c)


def test_resistance_at_rest_is_that_of_the_cold_wire():
    ohm = 17.0 * (1.0 - 0.12 * swing(2.0, 9.0, 3) / WIRE.travel_mm)
    found = rest_resistance(WIRE, heated(ohm, np.random.default_rng(1)))
    assert found.ohm.value == pytest.approx(17.0, rel=1e-3)
    assert found.spread < 0.002
    assert found.at_c == 80.0


def test_standard_error_is_a_share_of_the_resistance_at_rest():
    ohm = 17.0 * (1.0 - 0.12 * swing(2.0, 9.0, 3) / WIRE.travel_mm)
    one, twice = (rest_resistance(WIRE, heated(factor * ohm)).ohm for factor in (1.0, 2.0))
    assert twice.value == pytest.approx(2.0 * one.value)
    assert twice.error == pytest.approx(2.0 * one.error)


def test_wrong_model_of_the_resistance_shows_as_spread():
    ohm = 17.0 * (1.0 - 0.20 * swing(2.0, 9.0, 3) / WIRE.travel_mm)
    found = rest_resistance(WIRE, heated(ohm))
    assert found.spread == pytest.approx(0.5 * 0.08 * 7.0 / 12.0, rel=0.5)
    assert found.ohm.error > 0.005 * 16.5


def test_too_few_samples_leave_the_resistance_unknown():
    some = HeatedSamples(*(column[:30] for column in heated(np.full(TIME_S.size, 17.0))))
    none = HeatedSamples(*(column[:0] for column in heated(np.full(TIME_S.size, 17.0))))
    for found in (rest_resistance(WIRE, some), rest_resistance(WIRE, none)):
        assert isnan(found.ohm.value)
        assert isinstance(found, RestResistance)


def test_identification_is_read_from_the_wire_file(tmp_path):
    path = tmp_path / "wire.json"
    IdentifiedWire(MODEL, BALANCE, metrics={"rms_percent": 0.3}).save(path)
    entry, wire = identification_entry(path), load_wire(path)
    assert (entry.is_identification, entry.model, entry.model_percent) == (True, key_of(wire.model), 0.3)
    assert key_of(parse_wire(wire.text(), "a log").model) == entry.model
    assert entry.rest_ohm.value == 16.5
    assert entry.heating_c.value == pytest.approx(90.0, abs=0.1)
    assert entry.cooling_c.value == pytest.approx(69.0, abs=0.1)
    assert entry.begun == json.loads(path.read_text())["provenance"]["identified"]


def test_wire_without_heat_balance_has_no_resistance(tmp_path):
    path = tmp_path / "wire.json"
    IdentifiedWire(MODEL).save(path)
    assert not identification_entry(path).rest_ohm.is_known


def test_adapted_loop_is_compared_at_the_identified_displacement():
    """A model with another stroke passes the same displacement at another temperature."""
    larger = DuhemModel(MODEL.heating, MODEL.cooling, 1.2 * MODEL.scale, MODEL.offset, MODEL.input_range)
    assert loop_shape(larger).heating_c == pytest.approx(loop_shape(MODEL).heating_c)
    assert loop_shape(larger, MODEL).heating_c < loop_shape(MODEL).heating_c - 0.5
