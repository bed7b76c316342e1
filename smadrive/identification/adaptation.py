"""Online adaptation: recursive least squares of the rules, for a wire that changes during its use.

A rule is described by two rates p, q ≥ 0: over the travel |v| of the input, the state w follows dw/d|v| = p (1 - w) - q
w. So contraction and boundedness are simple bounds of the parameters θ, and every step keeps these bounds:

    θ = (p, q of the heating rules, p, q of the cooling rules, ln scale)      p, q ≥ 0, p heating ≥ λ, q cooling ≥ λ

λ is the smallest allowed contraction rate. The measured temperature drives the model and the sensitivities z = ∂w/∂θ,
which obey the same linear law as w. The error e of the displacement y corrects θ with the gain K of a Kalman filter:

    e = y - offset - scale w      ψ = ∂y/∂θ      K = P ψ / (ψ'P ψ + r)      θ += K e      P -= K ψ'P

ψ is the sensitivity of y and ψ' its transpose, r the variance of its noise, P the covariance of θ. P begins as the
covariance P₀ of likely changes of a wire: its branches shift or widen, and its scale drifts. While the wire travels,
the filter forgets: θ is an Ornstein-Uhlenbeck process around its initial value θ₀,

    θ - θ₀ *= ρ      P = ρ² P + (1 - ρ²) P₀      ρ² = exp(-|dv| / forgetting_c)

So P never exceeds P₀, and θ returns to θ₀ in every direction that the samples do not determine. For example, until the
wire reaches its hot end, an error of the scale and an error of the rules at the hot end can compensate each other.
Errors within the dead zone count as noise: θ learns nothing from them, and larger errors are reduced by the dead zone.

A sample with a jump, or with an error larger than any likely change, is not used. The adaptation ends, and θ returns to
an earlier value, if the sensor shows no travel while the wire travels, or if its errors stay too large. No parameter
moves further from its initial value than `limit` standard deviations of the likely changes.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from math import exp, isfinite

import numpy as np

from smadrive.hysteresis import TSFuzzyDuhem
from smadrive.hysteresis.reversal import DeadBand
from smadrive.identification.reshape import shape_of
from smadrive.identification.tsfuzzy.sensitivity import laws_of
from smadrive.numerics.arrays import FloatArray

LEAST_RATE = 1e-3
"""The least contraction per input span; every rule keeps it."""

LONGEST_STEP = 0.25
"""The largest change of v in one step, in the unit of v. A larger change is divided."""


@dataclass(frozen=True, slots=True)
class AdaptationSettings:
    """Speed and range of the adaptation. Displacements are shares of the stroke, temperatures are in K.

    noise          standard deviation of the noise of the displacement
    dead_zone      displacement error up to which a sample changes no parameter
    drift_c        likely shift of a branch, K (standard deviation)
    drift          likely change of the scale and of the width of a branch, as a share (standard deviation)
    free           likely change of a single rate, as a share of the largest of this rate and its neighbours
    forgetting_c   travel in K over which the covariance of the parameters returns to its initial value (1/e is left)
    limit          largest distance of a parameter from its initial value, in standard deviations of the likely changes
    """

    noise: float = 0.015
    dead_zone: float = 0.002
    drift_c: float = 3.0
    drift: float = 0.05
    free: float = 0.03
    forgetting_c: float = 600.0
    limit: float = 5.0


GATE = 5.0
"""A sample with an error of more standard deviations than this is rejected."""
JUMP_PER_C, JUMP = 0.05, 0.15
"""A sample is also rejected if its error has jumped since the last accepted sample.

It may change by `GATE` standard deviations of the noise, plus JUMP_PER_C strokes per K of travel (at most JUMP).
"""
MOST_DISBELIEVED = 15
"""If more samples in a row than this are rejected, the sensor is faulty."""
TRUSTED_MARKS = 30
"""When a sensor turns out to be faulty, the parameters of this many checks earlier are restored."""
STUCK_TRAVEL, STUCK_RANGE = 0.04, 0.1
"""A sensor is stuck if it shows less than STUCK_RANGE of a predicted travel of more than STUCK_TRAVEL strokes."""


class Adaptation:
    """Adapts the rules of one wire: `update` takes a sample, `model` returns the present rules.

    `sensor_fault` is the reason why the adaptation has ended. It is None while the adaptation works.
    """

    def __init__(self, model: TSFuzzyDuhem, noise_c: float, settings: AdaptationSettings | None = None) -> None:
        self._settings = settings or AdaptationSettings()
        self._base = model
        self._sets = len(model.sets.centres)
        self._theta = self._initial = _theta(model)
        lower, upper = model.input_range
        self._prior = _prior(model, self._settings)
        reach = self._settings.limit * np.sqrt(np.diag(self._prior))
        self._low, self._high = self._theta - reach, self._theta + reach
        floor = np.zeros(4 * self._sets)
        floor[: self._sets] = floor[3 * self._sets :] = LEAST_RATE / (upper - lower)
        self._low[:-1] = np.maximum(self._low[:-1], floor)
        self._covariance = self._prior.copy()
        self._dead_band = DeadBand(0.5 * noise_c)
        self._v: float | None = None
        self._w = 0.0
        self._z = np.zeros(4 * self._sets)
        self._disbelieved, self._believed_error, self._since_believed_c = 0, 0.0, 0.0
        self._predicted = self._measured = (0.0, 0.0)
        self.sensor_fault: str | None = None
        self._marked = deque([self._theta], TRUSTED_MARKS)

    @property
    def model(self) -> TSFuzzyDuhem:
        """A model with the present rules, which contract and are bounded. Another thread may read this property."""
        theta = self._theta  # every step makes a new array
        base, laws = self._base, laws_of(*theta[:-1].reshape(4, -1))
        return TSFuzzyDuhem.from_laws(base.sets, *laws, base.scale * exp(theta[-1]), base.offset, base.input_range)

    @property
    def _scale(self) -> float:
        return self._base.scale * exp(self._theta[-1])

    def update(self, temperature_c: float, displacement_mm: float) -> None:
        """Learn from one sample. Without a temperature or displacement (NaN) the sample changes no parameter."""
        if not isfinite(temperature_c):
            return
        v = self._dead_band.update(temperature_c)
        if self._v is None:
            if isfinite(displacement_mm):
                self._v, self._w = v, self._base.initial_state(v, displacement_mm).w
                self._mark(displacement_mm, displacement_mm)
            return
        travel = abs(v - self._v)
        self._move(v)
        if self.sensor_fault is None and isfinite(displacement_mm) and travel:
            self._since_believed_c += travel
            self._forget(travel)
            self._learn(displacement_mm)
            self._watch(displacement_mm)

    def _move(self, v: float) -> None:
        """Advance state and sensitivities to the input `v`, in pieces over which the law counts as constant."""
        start = self._v if self._v is not None else v
        pieces = max(1, int(np.ceil(abs(v - start) / LONGEST_STEP)))
        step = (v - start) / pieces
        for piece in range(pieces if step else 0):
            self._piece(start + (piece + 0.5) * step, step)
        self._v = v

    def _piece(self, middle: float, step: float) -> None:
        """Advance over one piece with dw/d|v| = p (1 - w) - q w, exact in w; z uses w in the middle of the piece."""
        lower, upper = self._base.input_range
        if not lower <= middle <= upper:
            return
        sets, length = self._sets, abs(step)
        weights = self._base.sets.weights(np.array([middle]))[0]
        first = 0 if step > 0 else 2 * sets
        p = float(weights @ self._theta[first : first + sets])
        q = float(weights @ self._theta[first + sets : first + 2 * sets])
        before, decay = self._w, exp(-(p + q) * length)
        if p + q > 0:
            self._w = p / (p + q) + (before - p / (p + q)) * decay
        middle_w = 0.5 * (before + self._w)
        self._z *= decay
        self._z[first : first + sets] += (1.0 - middle_w) * length * weights
        self._z[first + sets : first + 2 * sets] -= middle_w * length * weights

    def _forget(self, travel: float) -> None:
        """Move θ and P back towards their initial values. A convex combination of certified rules is certified, too."""
        kept = exp(-travel / self._settings.forgetting_c)
        self._theta = self._initial + kept**0.5 * (self._theta - self._initial)
        self._covariance = kept * self._covariance + (1.0 - kept) * self._prior

    def _learn(self, displacement_mm: float) -> None:
        """Make one step of the filter, unless the error is within the dead zone or the sample is rejected."""
        settings, stroke = self._settings, abs(self._base.scale)
        error = (displacement_mm - self.predicted_mm) / stroke
        slope = np.append(self._scale * self._z, self._scale * self._w) / stroke
        direction = self._covariance @ slope
        variance = float(slope @ direction) + settings.noise**2
        jump = abs(error - self._believed_error) - min(JUMP_PER_C * self._since_believed_c, JUMP)
        believable = float(slope @ self._prior @ slope) + settings.noise**2
        if abs(error) > GATE * believable**0.5 or jump > GATE * settings.noise:
            self._disbelieved += 1
            return
        self._disbelieved, self._believed_error, self._since_believed_c = 0, error, 0.0
        if abs(error) < settings.dead_zone:
            return
        gain = direction / variance
        beyond = error - np.copysign(settings.dead_zone, error)
        self._theta = np.clip(self._theta + gain * beyond, self._low, self._high)
        self._covariance -= np.outer(gain, direction)

    @property
    def predicted_mm(self) -> float:
        """The displacement that the present rules predict, mm."""
        return self._base.offset + self._scale * self._w

    def _watch(self, displacement_mm: float) -> None:
        """End the adaptation if too many samples are rejected, or if the sensor stands still while the wire travels."""
        predicted_mm = self.predicted_mm
        self._predicted = min(self._predicted[0], predicted_mm), max(self._predicted[1], predicted_mm)
        self._measured = min(self._measured[0], displacement_mm), max(self._measured[1], displacement_mm)
        travel_mm = self._predicted[1] - self._predicted[0]
        if self._disbelieved > MOST_DISBELIEVED:
            self._end("the displacement error stays larger than any likely change of the wire explains")
        elif travel_mm > STUCK_TRAVEL * abs(self._base.scale):
            if self._measured[1] - self._measured[0] < STUCK_RANGE * travel_mm:
                self._end("the displacement stands still while the wire travels")
            else:
                self._mark(predicted_mm, displacement_mm)

    def _mark(self, predicted_mm: float, measured_mm: float) -> None:
        """Keep the present parameters, because the sensor has followed the wire since the last check."""
        self._predicted, self._measured = (predicted_mm, predicted_mm), (measured_mm, measured_mm)
        self._marked.append(self._theta)

    def _end(self, why: str) -> None:
        self.sensor_fault = why
        self._theta = self._marked[0]


def _theta(model: TSFuzzyDuhem) -> FloatArray:
    (a_heating, b_heating), (a_cooling, b_cooling) = model.heating_law, model.cooling_law
    return np.concatenate([b_heating, -a_heating - b_heating, -b_cooling, a_cooling + b_cooling, [0.0]])


def _prior(model: TSFuzzyDuhem, settings: AdaptationSettings) -> FloatArray:
    """Return the covariance of the likely changes: shift and width of each branch, scale, and each single rule."""
    centres, shape = np.array(model.sets.centres), shape_of(model)
    rates = _theta(model)[:-1].reshape(4, -1)
    covariance = np.zeros((rates.size + 1, rates.size + 1))
    for rows, mu in ((slice(0, 2), shape.mu_heating), (slice(2, 4), shape.mu_cooling)):
        for way in (-1.0, 1.0):
            for shift_c, stretch in ((way * settings.drift_c, 1.0), (0.0, 1.0 + way * settings.drift)):
                moved = rates.copy()
                back = mu + (centres - shift_c - mu) / stretch
                moved[rows] = [np.interp(back, centres, rate) / stretch for rate in rates[rows]]
                change = np.append((moved - rates).ravel(), 0.0)
                covariance += 0.5 * np.outer(change, change)
    around = np.maximum.reduce([np.roll(np.pad(rates, ((0, 0), (1, 1)), "edge"), n, axis=1) for n in (-1, 0, 1)])[
        :, 1:-1
    ]
    free = settings.free * np.maximum(around, rates.max(axis=1, keepdims=True) / 10.0).ravel()
    return covariance + np.diag(np.append(free**2, settings.drift**2))
