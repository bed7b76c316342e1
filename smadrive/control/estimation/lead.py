"""The change of the leads since the identification.

Two-wire sensing measures the wire together with its leads and contacts. The identified resistance contains the leads
and contacts at the time of the identification. Since then a contact may have changed by δ, in Ω. Whenever the phase of
the wire is known, its resistance R(T, ξ) is known, too, and each sample measures δ:

    z = U/I - R(T, ξ)        variance of z: (σ_U / I)² + (dR/dξ σ_ξ)²

The phase is known while the wire is so cold that it is martensite after any history, and while a displacement sensor is
valid. A Kalman filter with one state gives the mean m and the variance P of a changed δ. Leads drift slowly: the filter
must not follow a sensor that slides. The errors of the temperature and of the fit do not average out, so their variance
S is added to P when m is judged.

A rig that was not touched has δ = 0 exactly, so a small m is more probably noise than a change. With the probability
`CHANGED` of a change before the samples, and the prior variance P_0, the probability after the samples is p, by the
Bayes factor of Savage and Dickey (Dickey, Ann. Math. Stat. 42, 1971):

    p = CHANGED / (CHANGED + (1 - CHANGED) sqrt(P_0/(P + S)) exp(-m²/2(P + S)))        δ = p m
"""

from __future__ import annotations

from math import exp, sqrt
from typing import NamedTuple

CHANGED = 0.03
"""Probability that leads or contacts have changed since the identification."""

CHANGE = 0.003
"""Standard deviation of a change, as a share of the resistance; crimps and plugs change by this much."""

DRIFT = 2e-6
"""Drift of δ after one second, as a share of the resistance."""

TEMPERATURE_C = 0.08
"""Error of the estimated temperature of a wire at rest, K."""


class LeadChange(NamedTuple):
    """The state of the filter: the mean m of a changed δ, its variance P, and its prior variance P_0, in Ω and Ω²."""

    mean_ohm: float
    variance: float
    prior_variance: float

    @classmethod
    def unknown(cls, resistance_ohm: float) -> LeadChange:
        """Return the state before the first sample."""
        variance = (CHANGE * resistance_ohm) ** 2
        return cls(0.0, variance, variance)

    def later(self, resistance_ohm: float, dt_s: float) -> LeadChange:
        """Return the state after `dt_s` without a sample. P grows, at most to the prior variance P_0."""
        drifted = self.variance + (DRIFT * resistance_ohm) ** 2 * dt_s
        return self._replace(variance=min(drifted, self.prior_variance))

    def measured(self, ohm: float, variance: float) -> LeadChange:
        """Return the state after the sample z = `ohm` with this variance."""
        gain = self.variance / (self.variance + variance)
        mean_ohm = self.mean_ohm + gain * (ohm - self.mean_ohm)
        return self._replace(mean_ohm=mean_ohm, variance=(1.0 - gain) * self.variance)

    def estimate(self, systematic: float) -> tuple[float, float]:
        """Return the expected δ, Ω, and its variance, Ω². `systematic` is the variance S of the lasting errors."""
        mean_ohm, variance = self.mean_ohm, self.variance + systematic
        unchanged = sqrt(self.prior_variance / variance) * exp(-0.5 * mean_ohm**2 / variance)
        probability = CHANGED / (CHANGED + (1.0 - CHANGED) * unchanged)
        ohm = probability * mean_ohm
        return ohm, probability * (variance + mean_ohm**2) - ohm**2
