"""The displacement by the resistance: lost bands, the sense current, the temperature of a cold wire."""

import dataclasses

import numpy as np
import pytest

from smadrive.hysteresis import DuhemModel
from smadrive.wire.heat_balance import HeatBalance
from smadrive.wire.identified_resistance import WireResistance
from smadrive.wire.observability import (
    LEAD_OHM,
    SENSE_HEAT,
    SENSE_NOISE,
    cold_c,
    lead_error,
    lead_text,
    lost_band,
    sense_current,
)
from smadrive.wire.wire_model import WireModel

MODEL = DuhemModel.gaussian(
    mu_heating=90, mu_cooling=69, sigma_heating=5, sigma_cooling=5, scale=12, input_range=(20, 140)
)
WIRE = WireModel(MODEL, HeatBalance(0.029, 0.012, 0.83, 22.0, 16.5, -0.12, 0.15))
FLAT = WireResistance(70.0, 16.5, 0.0, 0.0, 0.004, 0.001, 0.0, (20.0, 80.0, 140.0), (14.5,) * 3)
STEEP = dataclasses.replace(FLAT, austenite_ohm=(11.0, 16.0, 21.0))


@pytest.mark.parametrize("rising", [True, False])
def test_nothing_is_lost_if_the_resistance_only_falls(rising):
    assert lost_band(WIRE, FLAT, rising=rising) is None


def test_band_is_lost_where_the_resistance_turns_back():
    low_mm, high_mm = lost_band(WIRE, STEEP, rising=True)
    assert 0.0 < low_mm < high_mm < 12.0
    celsius = np.linspace(*MODEL.input_range, 2000)
    phase = MODEL.branch(celsius, rising=True)
    ohm = np.array([STEEP.ohm(*place) for place in zip(celsius.tolist(), phase.tolist(), strict=True)])
    inside = (phase > 0.03) & (phase < 0.97)
    turn_mm = 12.0 * phase[inside][np.argmin(ohm[inside])]
    assert low_mm < turn_mm < high_mm


def test_sense_current_keeps_its_noise():
    sense = sense_current(WIRE, FLAT)
    assert sense.noise == pytest.approx(SENSE_NOISE)
    assert sense.heat < SENSE_HEAT
    assert sense.current_a == pytest.approx(FLAT.noise_v / (SENSE_NOISE * 2.0), rel=0.01)


def test_heat_limits_the_sense_current_of_a_noisy_device():
    sense = sense_current(WIRE, dataclasses.replace(FLAT, noise_v=0.05))
    assert sense.heat == pytest.approx(SENSE_HEAT)
    assert sense.noise > SENSE_NOISE


def test_cold_wire_is_martensite_on_both_branches():
    celsius = cold_c(WIRE, FLAT)
    assert 45.0 < celsius < 69.0 - 2.5 * 5.0
    assert MODEL.branch(np.array([celsius]), rising=False)[0] < 0.002


def test_error_by_the_leads_is_their_share_of_the_change():
    assert lead_error(WIRE, FLAT) == pytest.approx(LEAD_OHM / 2.0)
    assert f"{100 * LEAD_OHM / 2.0:.2g} %" in lead_text(WIRE, FLAT)
