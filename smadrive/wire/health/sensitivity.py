"""The tracking error that a changed wire causes in a run without a displacement sensor, in % of the stroke (RMS).

The reference is taken as uniform over the stroke, and a branch as a Gaussian with the standard deviation σ.

- A shift d of a branch moves the displacement by d times the slope of the branch. With the slope p of a Gaussian, the
  mean of the squared error over the stroke is d² ∫ p³ dv, so the RMS is  d / (σ √(2π√3)).
- A change s of the stroke changes a displacement y by s y, so the RMS is  s / √3.
- A change r of the resistance changes the heat by the share r. A temperature loop with the closed-loop time τ_c, on a
  wire with the time constant τ, limits the temperature error to  r (T - T_amb) τ_c/τ, with T in the middle of the loop.
  This error acts like a shift of both branches.

`allowed_percent` is the error that no identification removes: the error of the fit, and the error that the noise of the
thermocouple causes as a shift. Another identification is worthwhile if a drift causes a larger error than this.
"""

from __future__ import annotations

from math import hypot, isfinite, pi, sqrt
from typing import NamedTuple

SHIFT = 1.0 / sqrt(2.0 * pi * sqrt(3.0))
"""RMS error of a shift by one standard deviation of the branch, as a share of the stroke."""

STROKE = 1.0 / sqrt(3.0)
"""RMS error of a stroke that has changed by its whole length, as a share of the stroke."""


class ErrorGains(NamedTuple):
    """The errors that changes of a wire cause, and the allowed error; errors are in % of the stroke (RMS).

    heating_per_k     error for a shift of the heating branch by 1 K, with the factor 1/√2 because it acts half the time
    cooling_per_k     the same for the cooling branch
    stroke            error for a change of the stroke by its whole length
    rest              error for a change of the resistance at rest by its whole value
    allowed_percent   error that no identification removes
    """

    heating_per_k: float
    cooling_per_k: float
    stroke: float
    rest: float
    allowed_percent: float


class LoopWidths(NamedTuple):
    """Standard deviations of both branches, and the loop's middle temperature minus the ambient temperature, in K."""

    heating_k: float
    cooling_k: float
    middle_k: float


def error_gains(widths: LoopWidths, *, loop_share: float, noise_c: float, fit_percent: float) -> ErrorGains:
    """Return the errors that changes of a wire cause.

    loop_share    closed-loop time over time constant of the wire, τ_c/τ
    noise_c       noise of the thermocouple, K
    fit_percent   RMS error of the fit in % of the stroke; an unknown error (NaN) counts as 0
    """
    heating, cooling = (100.0 * SHIFT / width / sqrt(2.0) for width in (widths.heating_k, widths.cooling_k))
    both = hypot(heating, cooling)
    allowed = hypot(both * noise_c, fit_percent if isfinite(fit_percent) else 0.0)
    return ErrorGains(heating, cooling, 100.0 * STROKE, both * widths.middle_k * loop_share, allowed)
