"""The resistance at rest of a wire, measured over a whole run.

A wire at rest is cold and has no current, so its resistance cannot be measured. The resistance at rest therefore
follows from samples with current. The heat balance gives the resistance R(w) at the phase w of each sample:

    R_rest = Σ V I / Σ (I² R(w) / R_cold)            over blocks of `BLOCK_S`, then the median of the blocks

The sums weigh a sample by its power, because an offset of voltage or current matters most at a small current. The
result and the identified resistance both include leads and contacts.
"""

from __future__ import annotations

from math import hypot, nan, sqrt
from typing import NamedTuple

import numpy as np

from smadrive.identification.thermal_fit.fit import SYSTEMATIC
from smadrive.numerics.arrays import FloatArray
from smadrive.numerics.residuals import samples_per_independent
from smadrive.safety.resistance_band import BLOCK_S, LEAST_SAMPLES
from smadrive.wire.health.entry import Estimate
from smadrive.wire.wire_model import WireModel


class RestResistance(NamedTuple):
    """The resistance at rest of a run. Unknown values are NaN.

    ohm       resistance at rest, Ω
    at_c      mean temperature of the samples, °C
    spread    largest deviation of a block from the resistance at rest, as a share
    """

    ohm: Estimate = Estimate()
    at_c: float = nan
    spread: float = nan


class HeatedSamples(NamedTuple):
    """The samples of a run that have enough current: arrays of the same shape (samples,)."""

    time_s: FloatArray
    current_a: FloatArray
    voltage_v: FloatArray
    displacement_mm: FloatArray
    temperature_c: FloatArray


def rest_resistance(wire: WireModel, samples: HeatedSamples) -> RestResistance:
    """Return the resistance at rest of `wire`; unknown if fewer than two blocks have `LEAST_SAMPLES` samples."""
    phase = np.clip(wire.phase_at(samples.displacement_mm), 0.0, 1.0)
    expected = 1.0 + wire.balance.resistance_change * phase
    starts = np.flatnonzero(np.diff(np.floor(samples.time_s / BLOCK_S), prepend=-1.0))
    if not starts.size:
        return RestResistance()
    is_full = np.diff(starts, append=len(samples.time_s)) >= LEAST_SAMPLES
    power = np.add.reduceat(samples.voltage_v * samples.current_a, starts)[is_full]
    blocks_ohm = power / np.add.reduceat(samples.current_a**2 * expected, starts)[is_full]
    if len(blocks_ohm) < 2:
        return RestResistance()
    rest_ohm = float(np.median(blocks_ohm))
    deviation = blocks_ohm / rest_ohm - 1.0
    error = hypot(_relative_error(deviation), SYSTEMATIC)
    at_c = float(np.nanmean(samples.temperature_c)) if np.isfinite(samples.temperature_c).any() else nan
    return RestResistance(Estimate(rest_ohm, error * rest_ohm), at_c, float(np.abs(deviation).max()))


def _relative_error(deviation: FloatArray) -> float:
    """Return the standard error of the mean of the blocks, which allows for the correlation of neighbouring blocks."""
    return float(np.std(deviation)) * sqrt(samples_per_independent(deviation - deviation.mean()) / len(deviation))
