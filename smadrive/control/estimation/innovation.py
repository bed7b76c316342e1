"""The innovation test of the observer: it tells a disturbance, such as a draft, from noise.

The innovation e is the measured minus the expected value. While the heat balance is right, e is white noise of the
standard deviation σ. A disturbance makes the mean of e differ from zero. The test is the exponentially weighted mean m:

    m <- (1 - λ) m + λ e          standard deviation of m: σ sqrt(λ / (2 - λ))

The evidence of a disturbance has a level from 0 to 1. The level grows from 0 to 1 while |m| grows from a first to a
second threshold, in units of this standard deviation. It decays with the time constant `HOLD_S`. With the level the
observer raises its Kalman gains (adaptive Kalman filter; Roberts, Technometrics 1, 1959, for the chart of the weighted
mean).

A draft begins or ceases within a second or two. Evidence that lasts longer has another cause: a bead that comes off
lags by seconds, and with larger gains for the temperatures the wire would overheat. So the integral of the level over
time is limited. The gains for shift and phase also follow a second level, `lasting`, without this limit: a load that
changes while the wire turns takes longer to learn, because there the displacement hardly depends on the temperature.

Spikes, and a noise larger than σ, also give evidence that lasts, but their innovations change sign. So `lasting` grows
only while the innovations of the displacement keep one sign. Their mean sign s goes from -1 to 1; a small innovation
counts in part:

    s <- s + `SIGN_WEIGHT` (min(max(e/σ, -1), 1) - s)

A sensor that is read more rarely than the loop runs repeats one innovation in several ticks. So `lasting` is 0 while a
reading is held.

A precise sensor that is read in every tick needs no `lasting`: the gains in calm air then find a changed load within
seconds. A wrong temperature, as of a bead that is half loose, gives innovations of one sign, too. With the larger gains
the shift would follow it and oscillate. So `lasting` is weighted by the noise ν of the displacement, as a multiple of
the least noise, and by the number n of ticks since the reading before. A reading in every tick, with the noise
ν sqrt(n), would tell as much:

    weight = min(log(ν sqrt(n)) / log(`LASTING_NOISES`), 1)
"""

from __future__ import annotations

from math import exp, hypot, log, sqrt
from typing import NamedTuple

READ_WEIGHT, PHASE_WEIGHT = 0.3, 0.5
"""Weight λ of the latest innovation: of the thermocouple, and of the displacement, which has less noise."""

READ_SPREAD, PHASE_SPREAD = 1.1, 1.5
"""Standard deviation σ of the innovations of the two sensors, as a multiple of the standard deviation of their noise.

It exceeds 1, because the model has errors, too.
"""

LAG_SHARE = 0.03
"""A wrong lag of the thermocouple adds innovations with this standard deviation, as a share of the gap.

The gap is the temperature difference between wire and thermocouple. Fast heating makes a gap of tens of kelvin, and is
no disturbance.
"""

READ_THRESHOLDS, PHASE_THRESHOLDS = (3.5, 7.0), (2.5, 5.0)
"""The level is 0 up to the first threshold, and 1 from the second on. Their unit is the standard deviation of m."""

HOLD_S = 1.0
"""Time constant in which the level decays, s."""

MOST_S, FORGET_S = 2.0, 20.0
"""The largest integral of the level over time, s, and the time constant in which this integral is forgotten, s.

At a larger integral the level is 0.
"""

SIGN_WEIGHT, SIGN_THRESHOLDS = 0.1, (0.5, 0.8)
"""Weight of the latest sign, and thresholds of the mean sign. White noise gives it a standard deviation up to 0.23."""

LASTING_NOISES = 4.0
"""At this multiple of the least noise, and above it, `lasting` has its whole weight."""


class DisturbanceEvidence(NamedTuple):
    """The state of the test.

    read_c    mean innovation of the thermocouple, K
    phase     mean innovation of the displacement, as a share of the travel
    level     0 while the innovations look like noise, 1 for a certain disturbance
    spent_s   integral of the level over time, forgotten with the time constant `FORGET_S`, s
    lasting   0 to 1 like the level, without its limit, for innovations of the displacement that keep their sign
    sign      mean sign of the innovations of the displacement, from -1 to 1
    repeated  part of the last innovation of the displacement that the earlier ones also had: twice their mean
    held      number of updates since the last new reading of the displacement
    """

    read_c: float = 0.0
    phase: float = 0.0
    level: float = 0.0
    spent_s: float = 0.0
    lasting: float = 0.0
    sign: float = 0.0
    repeated: float = 0.0
    held: int = 0


class InnovationTest:
    """The test for updates every `period_s`.

    `noise_c` and `noise` are the standard deviations of the noise of the thermocouple, K, and of the displacement, as a
    share of the travel.
    """

    def __init__(self, period_s: float, noise_c: float, noise: float) -> None:
        self._period_s = period_s
        self._decay, self._forget = exp(-period_s / HOLD_S), exp(-period_s / FORGET_S)
        self._read_c = READ_SPREAD * noise_c * sqrt(READ_WEIGHT / (2.0 - READ_WEIGHT))
        self._noise = PHASE_SPREAD * noise
        self._phase = self._noise * sqrt(PHASE_WEIGHT / (2.0 - PHASE_WEIGHT))

    def by_reading(self, before: DisturbanceEvidence, read_c: float, gap_c: float) -> DisturbanceEvidence:
        """Return the state after the innovation `read_c` of the thermocouple, K.

        `gap_c` is the difference between the temperatures of wire and thermocouple, K.
        """
        mean_c = before.read_c + READ_WEIGHT * (read_c - before.read_c)
        level, spent_s = self._limited(before, self._of_reading(mean_c, gap_c))
        return DisturbanceEvidence(mean_c, 0.0, level, spent_s)

    def by_both(
        self,
        before: DisturbanceEvidence,
        read_c: float,
        gap_c: float,
        phase_error: float,
        noises: float = 1.0,
        *,
        is_new: bool = True,
    ) -> DisturbanceEvidence:
        """Return the state after the innovations of thermocouple and displacement.

        `read_c` is the innovation of the thermocouple, K, `phase_error` of the displacement, as a share of the travel.
        `gap_c` is the difference between the temperatures of wire and thermocouple, K. The noise of this displacement
        is `noises` times the least one, at least 1. `is_new` is False for a displacement that is held since the last
        update.
        """
        phase_error /= noises
        mean_c = before.read_c + READ_WEIGHT * (read_c - before.read_c)
        mean = before.phase + PHASE_WEIGHT * (phase_error - before.phase)
        of_phase = _grown(abs(mean) / self._phase, PHASE_THRESHOLDS)
        level, spent_s = self._limited(before, max(self._of_reading(mean_c, gap_c), of_phase))
        sign = before.sign + SIGN_WEIGHT * (min(max(phase_error / self._noise, -1.0), 1.0) - before.sign)
        weight = min(log(noises * sqrt(before.held + 1), LASTING_NOISES), 1.0)
        persists = weight * of_phase * _grown(abs(sign), SIGN_THRESHOLDS)
        lasting = max(before.lasting * self._decay, persists) if is_new else 0.0
        held = 0 if is_new else before.held + 1
        return DisturbanceEvidence(mean_c, mean, level, spent_s, lasting, sign, 2.0 * before.phase, held)

    def _of_reading(self, mean_c: float, gap_c: float) -> float:
        return _grown(abs(mean_c) / hypot(self._read_c, LAG_SHARE * gap_c), READ_THRESHOLDS)

    def _limited(self, before: DisturbanceEvidence, grown: float) -> tuple[float, float]:
        """Return the level, which is `grown` or the decayed level of `before` if that is larger, and its integral."""
        level = max(before.level * self._decay, grown)
        spent_s = before.spent_s * self._forget + level * self._period_s
        return level if spent_s < MOST_S else 0.0, spent_s


def _grown(deviations: float, thresholds: tuple[float, float]) -> float:
    begins, certain = thresholds
    return min(max((deviations - begins) / (certain - begins), 0.0), 1.0)
