"""The controller of the excitation: the wire reaches every turning point, or an error names the reason."""

import dataclasses

import numpy as np
import pytest

from smadrive.control.controllers.excitation import LAGS_C, STALLS_S, ExcitationController
from smadrive.control.controllers.feedback import PIGains
from smadrive.errors import IdentificationError
from smadrive.identification.excitation_plans import planned_excitation
from smadrive.measurement import Measurement
from smadrive.wire.heat_balance import HeatBalance

NOMINAL = HeatBalance(0.0286, 0.014, 0.83, 22.0, 16.5, -0.1, 0.1)
EXCITATION = planned_excitation("nested", 40.0, 120.0, 6.0, start_c=22.0)
DT_S = 0.05


def excite(wire, current_limit_a=0.6):
    """Return the temperatures along the whole experiment, and its duration."""
    gains = PIGains.for_balance(NOMINAL, 0.5, 2.0)
    controller = ExcitationController(EXCITATION.temperature_c, EXCITATION.duration_s, NOMINAL, gains, current_limit_a)
    wire_c, time_s, temperatures = 22.0, 0.0, []
    while time_s <= controller.duration_s:
        commanded_a = controller.update(time_s, Measurement(time_s, wire_c, 0.0, 0.0), DT_S).commanded_a
        wire_c = wire.step(wire_c, min(commanded_a, current_limit_a) ** 2 * wire.resistance_cold_ohm, 0.0, DT_S)
        temperatures.append(wire_c)
        time_s += DT_S
    return np.array(temperatures), time_s


def test_path_does_not_wait_for_a_nominal_wire():
    temperatures, took_s = excite(NOMINAL)
    assert took_s == pytest.approx(EXCITATION.duration_s, abs=1.0)
    assert temperatures.max() > 118.0


def test_path_waits_for_a_wire_that_cools_slowly():
    slow = dataclasses.replace(NOMINAL, loss_w_per_k=0.005, heat_capacity_j_per_k=0.036)
    temperatures, took_s = excite(slow)
    assert took_s > EXCITATION.duration_s + 5.0
    after_first_top = temperatures[int(np.argmax(temperatures > 115.0)) :]
    assert after_first_top.min() < 40.0 + LAGS_C


def test_wire_that_stays_too_cold_ends_the_excitation_with_the_cure():
    with pytest.raises(IdentificationError) as error:
        excite(NOMINAL, current_limit_a=0.22)
    assert error.value.where == "excitation"
    assert f"{STALLS_S:g} s" in error.value.what
    assert 0 < error.value.cure.find("calibration") < error.value.cure.find("raise current_max_a if")


def test_wire_that_stays_too_warm_ends_the_excitation_with_the_cure():
    with pytest.raises(IdentificationError) as error:
        excite(dataclasses.replace(NOMINAL, ambient_c=55.0))
    assert "raise low_c or cool the surroundings" in error.value.cure
