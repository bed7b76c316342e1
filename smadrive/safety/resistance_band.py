"""The resistance at rest that a wire in use can have, and the check of a run against it.

A measured resistance V/I belongs to a range of resistances at rest, because the phase w is known as a range only:

    R_rest = (V/I) / f(w)        f(w) = R(w) / R_cold        w from the displacement ± m, or between the branches at T

m is the margin of the displacement band. The samples of a block give one range, from the sums of V I and of I² f(w).
Noise and offsets of V and I matter most at a small current, and in these sums a small current has little weight, so the
range is narrow. The resistance has jumped when the whole range lies farther from the expected resistance at rest than
the tolerance, in three of the last four blocks. A cracked crimp, a broken strand or another wire causes such a jump.

The expected resistance and its tolerance come from the health record of the wire. During a run the expected resistance
follows the measured range slowly, so the drift of a long run is not a jump.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite
from typing import TYPE_CHECKING, NamedTuple

from smadrive.measurement import Measurement
from smadrive.safety.debounce import Debounce
from smadrive.safety.displacement_band import MARGIN, DisplacementBand
from smadrive.wire.wire_model import WireModel

if TYPE_CHECKING:
    from smadrive.wire.health.expected_rest import ExpectedRest

BLOCK_S, LEAST_SAMPLES = 2.0, 5
"""A block lasts at least this time, and has at least this number of samples with enough current."""

LEAST_SHARE = 0.1
"""Least current of a sample that counts, as a share of current_max_a."""

FOLLOW_S = 600.0
"""Time constant with which the expected resistance follows the measured resistance, s."""


def current_min_a(current_max_a: float) -> float:
    """Return the least current in A at which a resistance is measured."""
    return LEAST_SHARE * current_max_a


class JumpedResistance(NamedTuple):
    """A jump of the resistance at rest.

    rest_ohm       end of the measured range that is nearest to the expected resistance, Ω
    expected_ohm   expected resistance at rest, Ω
    tolerance      tolerance, as a share of the expected resistance
    """

    rest_ohm: float
    expected_ohm: float
    tolerance: float

    def texts(self) -> tuple[str, str]:
        """Return the detail and the limit of the fault."""
        detail = f"{self.rest_ohm:.4g} Ω at rest, {self.expected_ohm:.4g} Ω expected"
        return detail, f"± {100.0 * self.tolerance:.2g} %"


@dataclass(slots=True)
class _Block:
    """Sums over the samples of a block: V I, and I² f(w) for the smallest and the largest f(w)."""

    begun_s: float
    samples: int = 0
    power_w: float = 0.0
    least: float = 0.0
    most: float = 0.0


class ResistanceBand:
    """Checks the resistance of a run, as described at the head of this file."""

    def __init__(
        self, wire: WireModel, displacement_band: DisplacementBand, expected: ExpectedRest, current_max_a: float
    ) -> None:
        self._wire = wire
        self._displacement_band = displacement_band
        self._expected_ohm, self._tolerance = expected
        self._least_a = current_min_a(current_max_a)
        self._block: _Block | None = None
        self._outside = Debounce(3, 4)

    def jumped(self, measurement: Measurement) -> JumpedResistance | None:
        """Add one measurement. If it completes a block and the resistance has jumped, return the jump; else None."""
        current_a, voltage_v = measurement.current_a, measurement.voltage_v
        if not (current_a >= self._least_a and isfinite(voltage_v)):
            return None
        phases = self._phases(measurement)
        if phases is None:
            return None
        if self._block is None:
            self._block = _Block(measurement.time_s)
        block, cold_ohm = self._block, self._wire.balance.resistance_cold_ohm
        factors = [self._wire.balance.resistance_ohm(phase) / cold_ohm for phase in phases]
        block.samples += 1
        block.power_w += voltage_v * current_a
        block.least += current_a * current_a * min(factors)
        block.most += current_a * current_a * max(factors)
        if block.samples < LEAST_SAMPLES or measurement.time_s - block.begun_s < BLOCK_S:
            return None
        self._block = None
        return self._checked(block.power_w / block.most, block.power_w / block.least)

    def _phases(self, measurement: Measurement) -> tuple[float, float] | None:
        """Return the ends of the range of possible phases; None if neither displacement nor temperature is known."""
        if isfinite(measurement.displacement_mm):
            phase = self._wire.phase_at(measurement.displacement_mm)
            return _clamped(phase - MARGIN), _clamped(phase + MARGIN)
        if not isfinite(measurement.temperature_c):
            return None
        first_mm, second_mm = self._displacement_band.band_mm(measurement.temperature_c)
        return _clamped(self._wire.phase_at(first_mm)), _clamped(self._wire.phase_at(second_mm))

    def _checked(self, low_ohm: float, high_ohm: float) -> JumpedResistance | None:
        """Compare the range of one block with the expected resistance, and return the jump or None.

        If the range is within the tolerance, the expected resistance follows it.
        """
        nearest_ohm = min(max(self._expected_ohm, low_ohm), high_ohm)
        is_outside = abs(nearest_ohm - self._expected_ohm) > self._tolerance * self._expected_ohm
        if self._outside.update(is_outside):
            return JumpedResistance(nearest_ohm, self._expected_ohm, self._tolerance)
        if not is_outside:
            self._expected_ohm += (nearest_ohm - self._expected_ohm) * BLOCK_S / FOLLOW_S
        return None


def _clamped(phase: float) -> float:
    return min(max(phase, 0.0), 1.0)
