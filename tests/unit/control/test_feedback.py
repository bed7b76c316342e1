"""The PI controller regulates its wire and does not wind up."""

from math import exp

import pytest

from smadrive.control.controllers.feedback import INTEGRATED_C, PIGains, TemperatureFeedback
from smadrive.wire.heat_balance import HeatBalance

WIRE = HeatBalance(0.029, 0.012, 0.83, 22.0, 16.5, -0.12, 0.15)
GAINS = PIGains.for_balance(WIRE, closed_loop_s=0.25, integral_s=5.0)


def run(feedback, setpoint_c, seconds, start_c=22.0, loss_error=1.0, dt_s=0.05):
    temperature_c = start_c
    for _ in range(round(seconds / dt_s)):
        power_w = feedback.update(setpoint_c - temperature_c, WIRE.power_w(setpoint_c, 0.0, 0.0), 6.0, dt_s)
        temperature_c = WIRE.step(temperature_c, power_w * loss_error, 0.0, dt_s)
    return temperature_c


def test_wrong_heat_balance_leaves_no_lasting_error():
    assert run(TemperatureFeedback(GAINS), 80.0, 60.0, loss_error=0.8) == pytest.approx(80.0, abs=0.05)


def test_closed_loop_has_the_chosen_time_constant():
    slow_integral = PIGains.for_balance(WIRE, closed_loop_s=0.25, integral_s=1e9)
    after = run(TemperatureFeedback(slow_integral), 42.0, 0.5, start_c=41.0, dt_s=0.002)
    assert 42.0 - after == pytest.approx(exp(-0.5 * (1 / 0.25 + 1 / WIRE.time_constant_s)), rel=0.03)


def test_long_saturation_does_not_change_the_integral():
    feedback = TemperatureFeedback(GAINS)
    for _ in range(1000):
        assert feedback.update(-40.0, 0.5, 6.0, 0.05) == 0.0
        assert feedback.update(+400.0, 0.5, 6.0, 0.05) == 6.0
    assert feedback.integral_w == 0.0


def test_large_error_counts_only_up_to_its_limit():
    feedback = TemperatureFeedback(GAINS)
    feedback.update(10.0, 0.5, 6.0, 1.0)
    assert feedback.integral_w == pytest.approx(GAINS.integral_w_per_k_s * INTEGRATED_C)


def test_large_error_is_removed_in_the_longest_recent_period():
    """On a slow bus a short period is followed by a long one, in which the same power would heat too far."""

    def power_w(*periods_s):
        feedback = TemperatureFeedback(GAINS)
        return [feedback.update(10.0, 0.5, 100.0, dt_s, small_c=1.0) for dt_s in periods_s][-1]

    assert power_w(0.35, 0.15) == pytest.approx(power_w(0.35), rel=0.05)
    assert power_w(0.15) > 1.5 * power_w(0.35)
