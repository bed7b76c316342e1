"""A controller whose first reading of the thermocouple is invalid commands no current until a valid one."""

from math import nan

import pytest

from smadrive.control.controllers.excitation import ExcitationController
from smadrive.control.controllers.feedback import PIGains
from smadrive.control.controllers.step import ConstantTemperatureController
from smadrive.identification.excitation import Excitation
from smadrive.measurement import Measurement
from smadrive.wire.heat_balance import HeatBalance

NOMINAL = HeatBalance(0.0286, 0.014, 0.83, 22.0, 16.5, -0.1, 0.1)
GAINS = PIGains.for_balance(NOMINAL, 0.5, 2.0)
PATH = Excitation((22.0, 120.0, 40.0), 6.0)
DT_S = 0.05


def excitation():
    return ExcitationController(PATH.temperature_c, PATH.duration_s, NOMINAL, GAINS, 0.6)


def step():
    return ConstantTemperatureController(80.0, 10.0, NOMINAL, GAINS, 0.6)


def commands(controller, readings_c):
    return [
        controller.update(n * DT_S, Measurement(n * DT_S, reading_c, 0.0, 0.0), DT_S)
        for n, reading_c in enumerate(readings_c)
    ]


@pytest.mark.parametrize("controller", [excitation, step])
def test_current_is_zero_until_the_first_valid_reading(controller):
    first, second, valid, lost = commands(controller(), (nan, nan, 22.0, nan))
    assert first.commanded_a == second.commanded_a == 0.0
    assert valid.commanded_a > 0.0
    assert lost.commanded_a > 0.0


def test_path_of_an_excitation_waits_for_the_first_valid_reading():
    controller = excitation()
    *_, late = commands(controller, (nan, nan, 22.0))
    (at_once,) = commands(excitation(), (22.0,))
    assert late.setpoint_c == pytest.approx(at_once.setpoint_c)
    assert controller.duration_s == pytest.approx(PATH.duration_s + 2 * DT_S)
