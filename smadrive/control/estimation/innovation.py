"""The innovation test of the observer: it tells a disturbance, such as a draft, from noise.

The innovation e is the measured minus the expected value. While the heat balance is right, e is white noise of the
standard deviation σ. A disturbance makes the mean of e differ from zero. The test is the exponentially weighted mean m:

    m <- (1 - λ) m + λ e          standard deviation of m: σ sqrt(λ / (2 - λ))

The doubt grows from 0 to 1 while |m| grows from one threshold to the next, in units of this standard deviation. It then
decays with `HOLD_S`. The observer uses larger Kalman gains while it doubts its prediction (adaptive Kalman filter;
Roberts, Technometrics 1, 1959, for the chart of the weighted mean).

A draft begins or ceases within a second or two. A doubt that lasts longer has another cause: a bead that comes off lags
by seconds, and with the larger gains the wire would overheat. So the integral of the doubt over time is limited.
"""

from __future__ import annotations

from math import exp, sqrt
from typing import NamedTuple

READ_WEIGHT, SEEN_WEIGHT = 0.3, 0.5
"""Weight λ of the latest innovation: of the thermocouple, and of the displacement, which has less noise."""

READ_SPREAD, SEEN_SPREAD = 1.1, 1.5
"""Standard deviation σ of the innovations, divided by that of the sensor's noise; the model has an error, too."""

READ_THRESHOLDS, SEEN_THRESHOLDS = (3.5, 7.0), (2.5, 5.0)
"""The doubt is 0 up to the first, and 1 from the second on, in standard deviations of the mean."""

HOLD_S = 1.0
"""Time constant in which the doubt decays, s."""

MOST_S, FORGET_S = 2.0, 20.0
"""The integral of the doubt over time at which the doubt ends, s, and the time constant in which it is forgotten, s."""


class Doubt(NamedTuple):
    """The state of the test.

    `read_c` is the mean innovation of the thermocouple in K, `seen` that of the displacement as a share of the travel.
    `doubt` is 0 while the innovations look like noise, up to 1 for a certain disturbance. `spent_s` is the integral of
    the doubt over time, which is forgotten slowly.
    """

    read_c: float = 0.0
    seen: float = 0.0
    doubt: float = 0.0
    spent_s: float = 0.0


class InnovationTest:
    """The test for updates every `period_s`.

    `noise_c` and `noise` are the standard deviations of the noise of the thermocouple, K, and of the displacement, as a
    share of the travel.
    """

    def __init__(self, period_s: float, noise_c: float, noise: float) -> None:
        self._period_s = period_s
        self._decay, self._forget = exp(-period_s / HOLD_S), exp(-period_s / FORGET_S)
        self._read_c = READ_SPREAD * noise_c * sqrt(READ_WEIGHT / (2.0 - READ_WEIGHT))
        self._seen = SEEN_SPREAD * noise * sqrt(SEEN_WEIGHT / (2.0 - SEEN_WEIGHT))

    def by_reading(self, before: Doubt, read_c: float) -> Doubt:
        """Return the state after the innovation `read_c` of the thermocouple, K."""
        mean_c = before.read_c + READ_WEIGHT * (read_c - before.read_c)
        return self._limited(before, mean_c, 0.0, _grown(abs(mean_c) / self._read_c, READ_THRESHOLDS))

    def by_both(self, before: Doubt, read_c: float, seen: float) -> Doubt:
        """Return the state after the innovations of thermocouple, K, and displacement, share of the travel."""
        mean_c = before.read_c + READ_WEIGHT * (read_c - before.read_c)
        mean = before.seen + SEEN_WEIGHT * (seen - before.seen)
        of_reading, of_seen = mean_c / self._read_c, mean / self._seen
        grown = max(_grown(abs(of_reading), READ_THRESHOLDS), _grown(abs(of_seen), SEEN_THRESHOLDS))
        return self._limited(before, mean_c, mean, grown)

    def _limited(self, before: Doubt, mean_c: float, mean: float, grown: float) -> Doubt:
        """Return the state with the doubt `grown`, or with the decayed doubt of `before` if that is larger."""
        doubt = max(before.doubt * self._decay, grown)
        spent_s = before.spent_s * self._forget + doubt * self._period_s
        return Doubt(mean_c, mean, doubt if spent_s < MOST_S else 0.0, spent_s)


def _grown(deviations: float, thresholds: tuple[float, float]) -> float:
    begins, certain = thresholds
    return min(max((deviations - begins) / (certain - begins), 0.0), 1.0)
