"""The controllers of the experiments, created from rig file, wire and model.

The rig runs such a controller on the wire; a replay runs the same controller on recorded measurements.
"""

from __future__ import annotations

from dataclasses import replace

from smadrive.control.controllers.excitation import ExcitationController
from smadrive.control.controllers.feedback import PIGains
from smadrive.control.controllers.interface import Controller
from smadrive.control.controllers.step import ConstantCurrentController, ConstantTemperatureController, ManualStep
from smadrive.control.controllers.tracking import TrackingController
from smadrive.control.controllers.tracking_feedback import TrackingSettings
from smadrive.control.feedforward.displacement import DisplacementInverse
from smadrive.control.references.reference import Reference
from smadrive.identification.excitation import Excitation
from smadrive.identification.excitation_plans import planned_excitation
from smadrive.measurement import DisplacementFrom
from smadrive.rig.config import ExcitationConfig, RigConfig
from smadrive.wire.heat_balance import HeatBalance
from smadrive.wire.wire_model import WireModel

EXCITATION_SLOWER = 2.0
"""Factor on `closed_loop_s` in an excitation and a manual step, which use the uncertain nominal heat balance."""


def excitation_path(config: ExcitationConfig, start_c: float) -> Excitation:
    """Return the temperature path of the identification experiment for a wire that is at `start_c` (°C) now.

    ConfigError if even the shortest path of the plan takes longer than `duration_s`.
    """
    return planned_excitation(
        config.plan,
        config.low_c,
        config.high_c,
        config.rate_c_per_s,
        min(start_c, config.high_c),
        reversals=config.reversals,
        duration_s=config.duration_s,
    )


def excitation_controller(config: RigConfig, excitation: Excitation, balance: HeatBalance) -> ExcitationController:
    """Return the controller that follows the temperature path of an identification experiment."""
    feedback = config.feedback
    return ExcitationController(
        excitation.temperature_c,
        excitation.duration_s,
        balance,
        PIGains.for_balance(balance, EXCITATION_SLOWER * feedback.closed_loop_s, feedback.integral_s),
        config.limits.current_max_a,
    )


def step_controller(config: RigConfig, step: ManualStep, balance: HeatBalance) -> Controller:
    """Return the controller that holds the current or the temperature of a manual step."""
    if step.current_a is not None:
        return ConstantCurrentController(step.current_a, step.duration_s)
    assert step.temperature_c is not None
    feedback = config.feedback
    gains = PIGains.for_balance(balance, EXCITATION_SLOWER * feedback.closed_loop_s, feedback.integral_s)
    current_max_a = config.limits.current_max_a
    return ConstantTemperatureController(step.temperature_c, step.duration_s, balance, gains, current_max_a)


def tracking_controller(
    config: RigConfig,
    reference: Reference,
    wire: WireModel,
    inverse: DisplacementInverse,
    displacement_from: DisplacementFrom | None = None,
) -> TrackingController:
    """Return the controller that makes the wire follow a displacement reference with the given inverse model.

    `displacement_from` replaces the source of the displacement in the rig file.
    """
    settings = tracking_settings(config)
    if displacement_from is not None:
        settings = replace(settings, displacement_from=displacement_from)
    return TrackingController(reference, wire, inverse, settings)


def tracking_settings(config: RigConfig) -> TrackingSettings:
    """Return the settings of the tracking controller, taken from the rig file."""
    return TrackingSettings(
        period_s=1.0 / config.rate_hz,
        current_limit_a=config.limits.current_max_a,
        closed_loop_s=config.feedback.closed_loop_s,
        integral_s=config.feedback.integral_s,
        noise_c=config.feedback.noise_c,
        feedforward_share=config.feedback.feedforward_share,
        displacement_from=config.displacement_from,
    )
