"""The PI controller that a campaign compares with the inverse: its gain, a missing displacement, and its use."""

from math import nan

import pytest

from smadrive.campaigns.experiments.controllers import DisplacementPI, controller_of
from smadrive.campaigns.experiments.identification import wire_of_model
from smadrive.control.controllers.tracking import TrackingController
from smadrive.control.references.shapes import sine
from smadrive.hysteresis import DuhemModel
from smadrive.measurement import Measurement
from smadrive.wire.heat_balance import HeatBalance
from smadrive.wire.wire_model import WireModel

BALANCE = HeatBalance(0.029, 0.012, 0.83, 22.0, 16.5, -0.12, 0.15)
REFERENCE = sine(low_mm=2.0, high_mm=5.0, period_s=40.0, cycles=1)


def controller(hot_c=140.0):
    model = DuhemModel.gaussian(
        mu_heating=90, mu_cooling=69, sigma_heating=5, sigma_cooling=5, scale=12, input_range=(20.0, hot_c)
    )
    return DisplacementPI(REFERENCE, WireModel(model, BALANCE), 0.6)


def measured(displacement_mm):
    return Measurement(0.0, 80.0, 0.2, 3.0, displacement_mm)


def test_missing_displacement_keeps_the_power():
    pi = controller()
    before = pi.update(10.0, measured(2.9), 0.05)
    assert pi.update(10.0, measured(nan), 0.05).power_w == before.power_w > 0.0
    assert pi.update(10.0, measured(3.2), 0.05).power_w < before.power_w


def test_gain_hardly_depends_on_a_range_that_ends_within_the_transformation():
    """Up to 97 °C the wire has some 92 % of its travel, and nearly the same slopes."""
    whole, cut = (controller(hot_c)._gain_w_per_mm for hot_c in (140.0, 97.0))
    assert cut == pytest.approx(whole, rel=0.05)


@pytest.mark.parametrize(
    ("settings", "kind"),
    [
        ("", DisplacementPI),
        ("displacement_sensor = false", TrackingController),
        ('rig.displacement_from = "none"', TrackingController),
        ('rig.displacement_from = "resistance"', TrackingController),
    ],
)
def test_feedback_uses_the_displacement_of_a_sensor_only(short_campaign, settings, kind):
    run = short_campaign(run=f'controller = "feedback-only"\n{settings}').run(0)
    knowledge = wire_of_model(run.settings.model)
    wire = WireModel(knowledge.wire.model, BALANCE)
    assert type(controller_of(run, knowledge, wire, REFERENCE).controller) is kind
