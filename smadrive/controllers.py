"""Which controller runs an experiment on a rig, put together from rig file, wire and model.

The rig runs it on the wire; a replay runs the same one on what was recorded.
"""

from __future__ import annotations

from smadrive.control.controller import TemperatureController, TrackingController
from smadrive.control.feedback import PIGains
from smadrive.control.feedforward import DisplacementFeedforward, DisplacementInverse
from smadrive.control.observer import WireObserver
from smadrive.control.reference import Reference
from smadrive.hysteresis import HysteresisModel
from smadrive.identification.excitation import Excitation
from smadrive.rigconfig import RigConfig
from smadrive.thermal import HeatBalance


def excitation_controller(config: RigConfig, excitation: Excitation, balance: HeatBalance) -> TemperatureController:
    """Follows the temperature path of an identification experiment with the nominal heat balance."""
    return TemperatureController(
        excitation.temperature_c,
        excitation.duration_s,
        balance,
        _gains(config, balance, slower=2.0),
        config.limits.current_max_a,
    )


def tracking_controller(
    config: RigConfig,
    reference: Reference,
    model: HysteresisModel,
    balance: HeatBalance,
    inverse: DisplacementInverse,
) -> TrackingController:
    """Follows a displacement reference with the given inverse."""
    return TrackingController(
        reference,
        WireObserver(balance, model, 1.0 / config.rate_hz, config.feedback.noise_c),
        DisplacementFeedforward(inverse, model, balance),
        balance,
        _gains(config, balance, slower=1.0),
        config.limits.current_max_a,
        config.feedback.feedforward_share,
    )


def _gains(config: RigConfig, balance: HeatBalance, slower: float) -> PIGains:
    feedback = config.feedback
    return PIGains.for_balance(balance, slower * feedback.closed_loop_s, feedback.integral_s)
