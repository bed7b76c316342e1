"""The controllers that a campaign compares: the inverse feedforward, and baselines without it.

inverse          the controller of `smadrive run`, on the identified model
duhem-inverse    the same controller on a Duhem model that is fitted to the same record
plain-map        the same controller with a static temperature map, without hysteresis
feedback-only    no feedforward: a PI controller from displacement to power. If the displacement does not come from a
                 sensor: only the temperature feedback, whose setpoint comes from the static map
"""

from __future__ import annotations

from dataclasses import replace
from math import isfinite
from typing import NamedTuple

import numpy as np

from smadrive.campaigns.experiments.identification import WireKnowledge
from smadrive.campaigns.plan.config import FitConfig
from smadrive.campaigns.plan.plan import PlannedRun
from smadrive.control.controllers.interface import Command, Controller
from smadrive.control.controllers.tracking import TrackingController
from smadrive.control.feedforward.displacement import DisplacementInverse, HysteresisInverse
from smadrive.control.feedforward.static_map import StaticMap
from smadrive.control.references.reference import Reference
from smadrive.identification.wire import identify_hysteresis
from smadrive.measurement import DisplacementFrom, Measurement
from smadrive.rig.controllers import tracking_settings
from smadrive.wire.wire_model import WireModel

SLOPE_POINTS = 1000
"""Number of points of the heating branch over which its slope is averaged."""


class DisplacementPI:
    """A PI controller from displacement to power, with its gain by lambda tuning at the mean slope of the loop.

    Its two time constants are the best of a sweep: shorter ones make the loop oscillate, longer ones make it lag.
    """

    CLOSED_LOOP_S = 0.05
    DELAY_S = 0.1
    INTEGRAL_S = 0.8

    def __init__(self, reference: Reference, wire: WireModel, limit_a: float) -> None:
        balance, scale = wire.balance, wire.model.scale
        slope_mm_per_k = scale * _mean_slope_per_k(wire)
        capacity_j_per_k = balance.heat_capacity_j_per_k + balance.latent_heat_j * slope_mm_per_k / wire.travel_mm
        self.duration_s = reference.duration_s
        self._reference, self._balance = reference, balance
        self._limit_w = limit_a**2 * balance.resistance_cold_ohm
        self._gain_w_per_mm = capacity_j_per_k / (slope_mm_per_k * (self.CLOSED_LOOP_S + self.DELAY_S))
        self._integral_w = self._power_w = 0.0

    def update(self, time_s: float, measurement: Measurement, dt_s: float) -> Command:
        """Return the command for the measured displacement. Without a measurement (NaN), the power stays."""
        setpoint_mm = self._reference.value_mm(time_s)
        if isfinite(measurement.displacement_mm):
            self._power_w = self._updated_w(setpoint_mm - measurement.displacement_mm, dt_s)
        return Command(self._balance.current_a(self._power_w, 0.0), setpoint_mm=setpoint_mm, power_w=self._power_w)

    def _updated_w(self, error_mm: float, dt_s: float) -> float:
        proportional_w = self._gain_w_per_mm * error_mm
        unclamped_w = proportional_w + self._integral_w
        power_w = min(max(unclamped_w, 0.0), self._limit_w)
        if power_w == unclamped_w or (unclamped_w < 0.0) == (proportional_w > 0.0):
            self._integral_w += proportional_w * dt_s / self.INTEGRAL_S
        return power_w


class RunController(NamedTuple):
    """The controller of a tracking run, its inverse, and the wire model that it uses. A log records the last two.

    A controller without an inverse has the static map as `inverse`.
    """

    controller: Controller
    inverse: DisplacementInverse
    wire: WireModel


def controller_of(run: PlannedRun, knowledge: WireKnowledge, wire: WireModel, reference: Reference) -> RunController:
    """Return the controller of a tracking run on the identified wire `wire`."""
    name, settings = run.settings.controller, tracking_settings(run.documents.rig)
    if name == "inverse":
        return _tracking(reference, wire, run)
    if name == "duhem-inverse":
        fit = identify_hysteresis(
            knowledge.temperature_c, knowledge.displacement_mm, FitConfig(kind="duhem").settings()
        )
        return _tracking(reference, WireModel(fit.model, wire.balance, wire.resistance), run)
    plain = _static_map(knowledge, wire)
    if name == "plain-map":
        return RunController(TrackingController(reference, wire, plain, settings), plain, wire)
    if run.settings.displacement_sensor and settings.displacement_from is DisplacementFrom.SENSOR:
        return RunController(DisplacementPI(reference, wire, settings.current_limit_a), plain, wire)
    feedback = TrackingController(reference, wire, plain, replace(settings, feedforward_share=0.0))
    return RunController(feedback, plain, wire)


def _tracking(reference: Reference, wire: WireModel, run: PlannedRun) -> RunController:
    inverse = HysteresisInverse(wire.model)
    controller = TrackingController(reference, wire, inverse, tracking_settings(run.documents.rig))
    return RunController(controller, inverse, wire)


def _static_map(knowledge: WireKnowledge, wire: WireModel) -> StaticMap:
    """Return the static map of the record or, if the wire comes from a model file, of the major loop of its model."""
    if knowledge.temperature_c.size:
        return StaticMap(knowledge.temperature_c, knowledge.displacement_mm)
    inputs_c = np.linspace(*wire.model.input_range, SLOPE_POINTS)
    loop_c = np.concatenate((inputs_c, inputs_c[::-1]))
    return StaticMap(loop_c, wire.model.simulate(loop_c))


def _mean_slope_per_k(wire: WireModel) -> float:
    """Return the mean of dw/dT over the heating branch, in 1/K. Each slope is weighted by its part dw of the branch."""
    inputs_c = np.linspace(*wire.model.input_range, SLOPE_POINTS)
    slopes_per_k, branch = (part(inputs_c, rising=True) for part in (wire.model.branch_slope, wire.model.branch))
    return float(np.average(slopes_per_k, weights=np.gradient(branch)))
