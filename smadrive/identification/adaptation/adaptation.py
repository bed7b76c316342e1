"""Online adaptation: recursive least squares of the model, for a wire that changes during its use.

The state of the model is w = (1 - share) x + share p. x is the state of the rules, p the state of the Preisach plane,
and share is 0 for a model without memory. The parameters θ are bounded so that every step keeps the certificates of
the model:

    θ = (rates of the rules, moves of the thresholds of the plane, ln scale)

rules_state.py and plane_state.py compute x and p with their sensitivities ∂x/∂θ and ∂p/∂θ. The measured temperature
drives x and p. A change of θ changes x and p as if the new θ had always been in force. y is the measured displacement.
The error e of the model corrects θ with the gain K of a Kalman filter:

    e = y - offset - scale w      ψ = -∂e/∂θ      K = P ψ / (ψ'P ψ + r)      θ += K e      P -= K ψ'P

ψ' is the transpose of ψ, r the variance of the noise of y, and P the covariance of θ. P begins as the covariance P₀ of
the likely changes of a wire: its branches shift or widen, and its scale drifts. While the wire travels, the filter
forgets: θ is an Ornstein-Uhlenbeck process around its initial value θ₀,

    θ - θ₀ *= ρ      P = ρ² P + (1 - ρ²) P₀      ρ² = exp(-|dv| / forgetting_c)

So P never exceeds P₀, and θ returns to θ₀ in every direction that the samples do not determine. For example, until the
wire reaches its hot end, an error of the scale and an error of the rules at the hot end can compensate each other.
Errors within the dead zone count as noise: θ learns nothing from them, and larger errors are reduced by the dead zone.
A wire at rest teaches nothing: as travel by the noise, its samples would count one error again and again.

A sample is rejected if its error is larger than any likely change explains, or if the error has jumped. The adaptation
ends, and θ returns to an earlier value, if the sensor shows no travel while the wire travels, or if too many samples in
a row are rejected. No parameter moves further from its initial value than `limit` standard deviations of its change.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from math import exp, isfinite, nan

import numpy as np

from smadrive.hysteresis import TSFuzzyDuhem, TSFuzzyPreisach
from smadrive.hysteresis.model import HysteresisState
from smadrive.hysteresis.reversal import DeadBand
from smadrive.identification.adaptation.likely_changes import LikelyChanges
from smadrive.identification.adaptation.plane_state import UNMOVED, PlaneState
from smadrive.identification.adaptation.rules_state import RulesState
from smadrive.identification.adaptation.travelled_ranges import TravelledRanges
from smadrive.identification.tsfuzzy.sensitivity import rates_of
from smadrive.numerics.arrays import FloatArray


@dataclass(frozen=True, slots=True)
class AdaptationSettings:
    """Speed and range of the adaptation. Displacements are shares of the stroke.

    noise          standard deviation of the noise of the displacement
    dead_zone      displacement error up to which the filter learns nothing from a sample
    forgetting_c   travel, K, after which 1/e of the change of the covariance by earlier samples is left
    limit          largest distance of a parameter from its initial value, in standard deviations of the likely changes
    likely         likely changes of the wire
    """

    noise: float = 0.015
    dead_zone: float = 0.002
    forgetting_c: float = 600.0
    limit: float = 5.0
    likely: LikelyChanges = field(default_factory=LikelyChanges)


ADAPTED = "adaptation"
"""The name of the changes of a tuning that the adaptation makes."""

GATE = 5.0
"""A sample is rejected if its error exceeds this number of standard deviations of likely changes and noise together."""
JUMP_PER_C, JUMP = 0.05, 0.15
"""A sample is also rejected if its error has jumped from the one that the last accepted sample and its correction left:
by more than `GATE` standard deviations of the noise, plus JUMP_PER_C strokes per K of travel (at most JUMP)."""
AT_REST = 3.0
"""Radius of the dead band of a wire at rest, in standard deviations of the noise of the temperature."""
MOST_DISBELIEVED = 15
"""The sensor is faulty if more than this number of samples in a row are rejected."""
TRUSTED_MARKS = 30
"""The parameters of this number of checks are kept. If the sensor is faulty, the oldest of them are restored."""
STUCK_TRAVEL, STUCK_RANGE = 0.04, 0.1
"""A sensor is stuck if it shows less than the share STUCK_RANGE of a predicted travel above STUCK_TRAVEL strokes."""


class Adaptation:
    """Adapts the model of one wire: `update` takes a sample, `model` returns the present model.

    `sensor_fault` is the reason why the adaptation has ended. It is None while the adaptation works.
    """

    def __init__(
        self, model: TSFuzzyDuhem | TSFuzzyPreisach, noise_c: float, settings: AdaptationSettings | None = None
    ) -> None:
        self._settings = settings or AdaptationSettings()
        self._base = model
        rules, self._plane, self._share, moves = _parts(model)
        self._rules, rates = RulesState(rules), rates_of(rules)
        self._of_rules, self._of_plane = slice(0, len(rates)), slice(len(rates), len(rates) + len(moves))
        self._theta = self._initial = np.concatenate([rates, moves, [0.0]])
        self._prior = self._settings.likely.covariance(model)
        reach = self._settings.limit * np.sqrt(np.diag(self._prior))
        self._low, self._high = self._theta - reach, self._theta + reach
        self._low[self._of_rules] = np.maximum(self._low[self._of_rules], self._rules.least)
        self._covariance = self._prior.copy()
        self._dead_band, self._rest = DeadBand(0.5 * noise_c), DeadBand(AT_REST * noise_c)
        self._rest_c = nan
        self._v: float | None = None
        self._disbelieved, self._believed_error, self._since_believed_c = 0, 0.0, 0.0
        self._predicted: float
        self._travel: TravelledRanges
        self.sensor_fault: str | None = None
        self._marked = deque([self._theta], TRUSTED_MARKS)

    @property
    def model(self) -> TSFuzzyDuhem | TSFuzzyPreisach:
        """The present model, whose certificates hold. Another thread may read this property."""
        theta = self._theta  # every step makes a new array
        rules = self._rules.model(theta[self._of_rules], self._base.scale * exp(theta[-1]))
        if self._plane is None:
            return rules
        return TSFuzzyPreisach(rules, self._plane.plane(theta[self._of_plane]), self._share)

    @property
    def _scale(self) -> float:
        return self._base.scale * exp(self._theta[-1])

    def update(self, temperature_c: float, displacement_mm: float, wire: HysteresisState | None = None) -> None:
        """Learn from one sample. Without a temperature or displacement (NaN) the sample changes no parameter.

        `wire` is the estimated state of the wire in the given model. The adaptation begins with its memory.
        """
        if not isfinite(temperature_c):
            return
        v, before_c = self._dead_band.update(temperature_c), self._rest_c
        self._rest_c = self._rest.update(temperature_c)
        if self._v is None:
            if isfinite(displacement_mm):
                self._start(v, displacement_mm, wire)
                self._predicted, _ = self._prediction()
                self._mark(displacement_mm / abs(self._base.scale))
            return
        travel = abs(v - self._v)
        self._rules.move(self._theta[self._of_rules], self._v, v)
        if self._plane is not None:
            self._plane.move(v)
        self._v = v
        self._since_believed_c += travel
        if self.sensor_fault is None and isfinite(displacement_mm) and travel and self._rest_c != before_c:
            measured = displacement_mm / abs(self._base.scale)
            predicted, _ = self._prediction()
            self._travel.add(measured, predicted - self._predicted)
            self._forget(travel)
            is_believed = self._learn(measured)
            self._predicted, _ = self._prediction()
            if is_believed:
                self._believed_error, self._since_believed_c = measured - self._predicted, 0.0
            self._watch(measured)

    def _start(self, v: float, displacement_mm: float, wire: HysteresisState | None) -> None:
        state = self._base.initial_state(v, displacement_mm)
        if wire is not None:
            state = self._base.corrected(wire, v, state.y)
        self._v, self._rules.x = v, state.w
        if self._plane is not None and state.memory is not None:
            self._rules.x = state.memory.local
            self._plane.start(state.memory.turns, v)

    def _state(self) -> tuple[float, FloatArray]:
        """Return the state w, and its derivatives with respect to the rates and the moves of the plane."""
        x, z = self._rules.x, self._rules.z
        if self._plane is None:
            return x, z
        p, over_moves = self._plane.state(self._theta[self._of_plane])
        rest, share = 1.0 - self._share, self._share
        return rest * x + share * p, np.concatenate([rest * z, share * over_moves])

    def _forget(self, travel: float) -> None:
        """Move θ and P back towards their initial values. A convex combination of certified rules is certified, too."""
        kept = exp(-travel / self._settings.forgetting_c)
        self._set(self._initial + kept**0.5 * (self._theta - self._initial))
        self._covariance = kept * self._covariance + (1.0 - kept) * self._prior

    def _set(self, theta: FloatArray) -> None:
        """Put θ in force, and change the state of the rules as if θ had always been in force (to first order).

        Otherwise the error of a wire at rest would stay, and every further sample would correct θ again.
        """
        self._rules.change(theta[self._of_rules] - self._theta[self._of_rules])
        self._theta = theta

    def _learn(self, measured: float) -> bool:
        """Step the filter, if the error is outside the dead zone. Return False if the sample is rejected."""
        settings = self._settings
        predicted, psi = self._prediction()
        error = measured - predicted
        jump = abs(error - self._believed_error) - min(JUMP_PER_C * self._since_believed_c, JUMP)
        believable = float(psi @ self._prior @ psi) + settings.noise**2
        if abs(error) > GATE * believable**0.5 or jump > GATE * settings.noise:
            self._disbelieved += 1
            return False
        self._disbelieved = 0
        if abs(error) < settings.dead_zone:
            return True
        direction = self._covariance @ psi
        gain = direction / (float(psi @ direction) + settings.noise**2)
        beyond = error - np.copysign(settings.dead_zone, error)
        self._set(np.clip(self._theta + gain * beyond, self._low, self._high))
        self._covariance -= np.outer(gain, direction)
        return True

    def _prediction(self) -> tuple[float, FloatArray]:
        """Return the displacement that the present model predicts, in strokes, and ψ."""
        w, slopes = self._state()
        stroke = abs(self._base.scale)
        return (self._base.offset + self._scale * w) / stroke, np.append(slopes, w) * self._scale / stroke

    @property
    def predicted_mm(self) -> float:
        """The displacement that the present model predicts, mm."""
        return self._prediction()[0] * abs(self._base.scale)

    def _watch(self, measured: float) -> None:
        """End the adaptation if too many samples are rejected, or if the sensor shows no travel of the wire."""
        travel = self._travel
        if self._disbelieved > MOST_DISBELIEVED:
            self.end("the displacement error stays larger than any likely change of the wire explains")
        elif travel.predicted > STUCK_TRAVEL:
            if travel.measured < STUCK_RANGE * travel.predicted:
                self.end("the displacement stands still while the wire travels")
            else:
                self._mark(measured)

    def _mark(self, measured: float) -> None:
        """Keep the present parameters and begin a new check: the sensor has followed the wire since the last check."""
        self._travel = TravelledRanges(measured)
        self._marked.append(self._theta)

    def end(self, why: str) -> None:
        """End the adaptation because of the sensor fault `why`, and restore earlier parameters."""
        self.sensor_fault = why
        self._theta = self._marked[0]


def _parts(model: TSFuzzyDuhem | TSFuzzyPreisach) -> tuple[TSFuzzyDuhem, PlaneState | None, float, FloatArray]:
    """Return the rules of the model, its plane (None without memory), the share of the plane, and the initial moves."""
    if isinstance(model, TSFuzzyPreisach):
        return model.local, PlaneState(model), model.share, UNMOVED
    return model, None, 0.0, np.empty(0)
