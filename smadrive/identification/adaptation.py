"""Online adaptation: recursive least squares of the rules, for a wire that changes during its use.

The rules are written by rates that must not be negative (see sensitivity.py), so contraction and boundedness are plain
bounds, kept at every step:

    θ = (p, q of the heating rules, p, q of the cooling rules, ln scale)      p, q ≥ 0, p heating ≥ λ, q cooling ≥ λ

Along the measured temperature the model runs beside the wire, and with it the sensitivities z = ∂w/∂θ, which obey the
same linear law. The error of the displacement corrects θ as a Kalman filter does, θ being a random walk:

    e = y - offset - scale w      ψ = ∂y/∂θ      K = P ψ / (ψ'P ψ + r)      θ += K e      P -= K ψ'P,  P += Q |dv|

The likely changes are: branches shift and widen, and the scale drifts. P begins as the covariance of such changes, and
Q is a share of it: the filter forgets along these directions, only while the wire travels, and P never exceeds its
initial value. Errors within the dead zone are noise and change nothing.

A sensor can fail. An error larger than any likely change, or a jump, is a spike and is not used. A sensor that stands
still while the wire travels, or whose errors stay too large, ends the adaptation, and θ returns to an earlier value. No
parameter moves further from its initial value than `limit` standard deviations of the likely changes.

Scale and hot rules are determined only by a wire that reaches its hot end: on a part of the travel they trade off.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from math import exp, isfinite

import numpy as np

from smadrive.hysteresis import TSFuzzyDuhem
from smadrive.hysteresis.reversal import DeadBand
from smadrive.identification.reshape import shape_of
from smadrive.numerics.arrays import FloatArray

LEAST_RATE = 1e-3
"""Contraction per input span that every rule keeps."""

LONGEST_STEP = 0.25
"""Longer moves of v are made in pieces, in units of v."""


@dataclass(frozen=True, slots=True)
class AdaptationSettings:
    """How fast and how far. Displacements in shares of the stroke, temperatures in K.

    noise, dead_zone    standard deviation of the displacement error that is noise; error below which nothing is learnt
    drift_c, drift      what changes: branches by so many K, the scale by this share (standard deviations)
    free                what rules change besides, as a share of their largest rate around
    forgetting_c        travel after which as much may have changed as at the beginning
    limit               how far parameters may go from where they began, in those standard deviations
    """

    noise: float = 0.015
    dead_zone: float = 0.002
    drift_c: float = 3.0
    drift: float = 0.05
    free: float = 0.03
    forgetting_c: float = 1500.0
    limit: float = 5.0


GATE = 5.0
"""Standard deviations beyond which a sample is rejected."""
JUMP_PER_C, JUMP = 0.05, 0.15
"""A change of the error beyond the gate plus this share of the stroke per K (at most JUMP) also rejects a sample."""
MOST_DISBELIEVED = 15
"""More rejected samples in a row than this mean a faulty sensor."""
TRUSTED_MARKS = 30
"""When a sensor proves faulty, the parameters of so many checks ago are restored."""
STUCK_TRAVEL, STUCK_RANGE = 0.04, 0.1
"""A sensor that shows less than this share of a predicted travel (share of the stroke) is stuck."""


class Adaptation:
    """Follows one wire: `update` for every sample, `model` for the present rules.

    `lying` says why the adaptation has ended, None while it works.
    """

    def __init__(self, model: TSFuzzyDuhem, noise_c: float, settings: AdaptationSettings | None = None) -> None:
        self._settings = settings or AdaptationSettings()
        self._base = model
        self._sets = len(model.sets.centres)
        self._theta = _theta(model)
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
        self.lying: str | None = None
        self._marked = deque([self._theta], TRUSTED_MARKS)

    @property
    def model(self) -> TSFuzzyDuhem:
        """The rules as they are now; certified, as contraction and bounds are kept. May be asked by another thread."""
        theta = self._theta  # every step makes a new one
        p_heating, q_heating, p_cooling, q_cooling = theta[:-1].reshape(4, -1)
        return TSFuzzyDuhem(
            self._base.sets,
            a_heating=-(p_heating + q_heating),
            b_heating=p_heating,
            a_cooling=p_cooling + q_cooling,
            b_cooling=-p_cooling,
            scale=self._base.scale * exp(theta[-1]),
            offset=self._base.offset,
            input_range=self._base.input_range,
        )

    @property
    def _scale(self) -> float:
        return self._base.scale * exp(self._theta[-1])

    def update(self, temperature_c: float, displacement_mm: float) -> None:
        """Learn from one sample: the wire's temperature and displacement (NaN: not measured, nothing is learnt)."""
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
        if self.lying is None and isfinite(displacement_mm) and travel:
            self._since_believed_c += travel
            self._covariance += (travel / self._settings.forgetting_c) * self._prior
            self._learn(displacement_mm)
            self._watch(displacement_mm)

    def _move(self, v: float) -> None:
        """Bring state and sensitivities to `v`, in pieces over which the law is constant."""
        start = self._v if self._v is not None else v
        pieces = max(1, int(np.ceil(abs(v - start) / LONGEST_STEP)))
        step = (v - start) / pieces
        for piece in range(pieces if step else 0):
            self._piece(start + (piece + 0.5) * step, step)
        self._v = v

    def _piece(self, middle: float, step: float) -> None:
        """dw/d|v| = p (1 - w) - q w in either direction, exactly over one piece; z with the drive in its middle."""
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

    def _learn(self, displacement_mm: float) -> None:
        """One step of the filter, unless the sample is within the dead zone or rejected."""
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
        self._hold_covariance()

    def _hold_covariance(self) -> None:
        """No parameter is less certain than it was at the beginning; correlations stay."""
        excess = np.sqrt(np.diag(self._prior) / np.maximum(np.diag(self._covariance), 1e-300))
        if excess.min() < 1.0:
            shrink = np.minimum(excess, 1.0)
            self._covariance *= np.outer(shrink, shrink)

    @property
    def predicted_mm(self) -> float:
        """The displacement that the present rules predict."""
        return self._base.offset + self._scale * self._w

    def _watch(self, displacement_mm: float) -> None:
        """Check the sensor, each time the wire has travelled far enough."""
        predicted_mm = self.predicted_mm
        self._predicted = min(self._predicted[0], predicted_mm), max(self._predicted[1], predicted_mm)
        self._measured = min(self._measured[0], displacement_mm), max(self._measured[1], displacement_mm)
        travel_mm = self._predicted[1] - self._predicted[0]
        if self._disbelieved > MOST_DISBELIEVED:
            self._end("the displacement stays further off than the wire can have changed")
        elif travel_mm > STUCK_TRAVEL * abs(self._base.scale):
            if self._measured[1] - self._measured[0] < STUCK_RANGE * travel_mm:
                self._end("the displacement stands while the wire travels")
            else:
                self._mark(predicted_mm, displacement_mm)

    def _mark(self, predicted_mm: float, measured_mm: float) -> None:
        """Note that the sensor has followed the wire so far."""
        self._predicted, self._measured = (predicted_mm, predicted_mm), (measured_mm, measured_mm)
        self._marked.append(self._theta)

    def _end(self, why: str) -> None:
        self.lying = why
        self._theta = self._marked[0]


def _theta(model: TSFuzzyDuhem) -> FloatArray:
    (a_heating, b_heating), (a_cooling, b_cooling) = model.heating_law, model.cooling_law
    return np.concatenate([b_heating, -a_heating - b_heating, -b_cooling, a_cooling + b_cooling, [0.0]])


def _prior(model: TSFuzzyDuhem, settings: AdaptationSettings) -> FloatArray:
    """Covariance of what is likely to change: each branch moved or widened either way, the scale, a little of all."""
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
