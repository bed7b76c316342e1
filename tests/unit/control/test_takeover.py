"""A controller takes over from another while the wire moves, without a jump of the command."""

import pytest

from smadrive.control.controllers.feedback import HANDOVER_S, SOON, PIGains, TemperatureFeedback
from smadrive.control.controllers.tracking import TrackingController
from smadrive.control.controllers.tracking_feedback import TrackingSettings
from smadrive.control.feedforward.displacement import HysteresisInverse
from smadrive.control.references.shapes import sine
from smadrive.hysteresis import DuhemModel
from smadrive.measurement import Measurement
from smadrive.wire.heat_balance import HeatBalance
from smadrive.wire.wire_model import WireModel

BALANCE = HeatBalance(0.029, 0.012, 0.83, 22.0, 16.5, -0.12, 0.15)
PERIOD_S = 0.05


def wire(mu_heating=90.0):
    return DuhemModel.gaussian(
        mu_heating=mu_heating, mu_cooling=69.0, sigma_heating=5.0, sigma_cooling=5.0, scale=12.0, input_range=(0, 200)
    )


def controller(model, feedforward_share=1.0):
    return TrackingController(
        sine(low_mm=3.0, high_mm=9.0, period_s=56.0),
        WireModel(model, BALANCE),
        HysteresisInverse(model),
        TrackingSettings(PERIOD_S, 0.6, 0.25, 5.0, 0.1, feedforward_share),
    )


def reading(time_s, temperature_c):
    return Measurement(time_s=time_s, temperature_c=temperature_c, current_a=0.26, voltage_v=4.0)


def test_command_does_not_jump_and_converges_to_that_of_the_new_controller():
    before = controller(wire())
    for tick in range(40):
        last = before.update(PERIOD_S * tick, reading(PERIOD_S * tick, 84.0), PERIOD_S)
    after, fresh = controller(wire(mu_heating=93.0)), controller(wire(mu_heating=93.0))
    after.take_over(before)
    fresh.take_over(before)
    replaced = before._feedback.temperature
    fresh._feedback.temperature = TemperatureFeedback(replaced.gains, replaced.integrated_c)
    fresh._feedback.temperature.integral_w = replaced.integral_w
    time_s = 40 * PERIOD_S
    jump_w = abs(fresh.update(time_s, reading(time_s, 84.0), PERIOD_S).power_w - last.power_w)
    assert jump_w > 0.1
    assert after.update(time_s, reading(time_s, 84.0), PERIOD_S).power_w == pytest.approx(last.power_w)
    powers = [
        [one.update(PERIOD_S * tick, reading(PERIOD_S * tick, 84.0), PERIOD_S).power_w for one in (after, fresh)]
        for tick in range(41, 41 + int(6 * HANDOVER_S / PERIOD_S))
    ]
    assert powers[-1][0] == pytest.approx(powers[-1][1], abs=0.01 * jump_w + 0.01)


def test_command_at_its_limit_leaves_no_difference():
    before, after = TemperatureFeedback(PIGains(0.1, 0.0, 0.05)), TemperatureFeedback(PIGains(0.1, 0.0, 0.05))
    assert before.update(-50.0, 0.0, 6.0, PERIOD_S) == 0.0
    after.take_over(before, 0.0)
    assert after.update(-20.0, 0.0, 6.0, PERIOD_S) == 0.0
    assert after.update(0.0, 1.5, 6.0, PERIOD_S) == 1.5


def test_estimate_continues_with_the_new_model():
    before = controller(wire())
    for tick in range(40):
        believed = before.update(PERIOD_S * tick, reading(PERIOD_S * tick, 90.0), PERIOD_S)
    after = controller(wire(mu_heating=90.5))
    after.take_over(before)
    goes_on = after.update(2.0, reading(2.0, 90.0), PERIOD_S)
    assert goes_on.estimated_c == pytest.approx(believed.estimated_c, abs=0.5)
    assert goes_on.estimated_mm == pytest.approx(believed.estimated_mm, abs=0.5)


def test_share_of_the_feedforward_leaves_the_rest_to_the_feedback():
    whole, half, quarter = (
        controller(wire(), share).update(0.0, reading(0.0, 84.0), PERIOD_S) for share in (1.0, 0.5, 0.25)
    )
    assert half.setpoint_c == whole.setpoint_c
    assert whole.power_w - half.power_w > 0.1
    assert whole.power_w - half.power_w == pytest.approx(2.0 * (half.power_w - quarter.power_w))


def test_large_error_jumps_and_is_removed_in_one_period():
    gains = PIGains(0.1, 0.0, 0.03)
    before, after = TemperatureFeedback(gains), TemperatureFeedback(gains)
    before.update(0.0, 1.0, 100.0, PERIOD_S)
    after.take_over(before, 0.0)
    power_w = after.update(23.0, 1.0, 100.0, PERIOD_S, small_c=3.0)
    assert power_w == pytest.approx(1.0 + 0.1 * 3.0 + SOON * 0.03 * 20.0 / PERIOD_S)
    assert after.update(23.0, 1.0, 6.0, PERIOD_S, small_c=3.0) == 6.0


def test_power_for_a_large_error_does_not_continue_after_a_takeover():
    gains = PIGains(0.1, 0.0, 0.03)
    before, after = TemperatureFeedback(gains), TemperatureFeedback(gains)
    assert before.update(23.0, 1.0, 100.0, PERIOD_S, small_c=3.0) > 5.0
    after.take_over(before, 0.0)
    assert after.update(0.0, 1.0, 100.0, PERIOD_S, small_c=3.0) == pytest.approx(1.0 + 0.1 * 3.0)
