"""References that hold the wire at a displacement, or move it to another one.

The path of a move has the smallest possible jerk. Its greatest speed is `PEAK` times its mean speed.
"""

from __future__ import annotations

from math import isfinite

from smadrive.control.references.reference import Reference
from smadrive.hysteresis import HysteresisModel
from smadrive.measurement import Measurement
from smadrive.safety.displacement_band import DisplacementBand

PEAK = 1.875
"""Greatest speed of a minimum-jerk path, 15/8 of its mean speed."""


def constant_reference(at_mm: float) -> Reference:
    """Return a reference that stays at `at_mm`."""
    return Reference.from_samples([0.0, 1.0], [at_mm, at_mm])


def holding_reference(model: HysteresisModel, measurement: Measurement) -> Reference:
    """Return a constant reference at the measured displacement; without a sensor, at the displacement of the model.

    The displacement is limited to the range of the model at this temperature, so that a sensor with a wrong zero
    does not make the controller heat a cold wire.
    """
    temperature_c, displacement_mm = measurement.temperature_c, measurement.displacement_mm
    if not isfinite(displacement_mm):
        displacement_mm = model.initial_state(temperature_c).y
    return constant_reference(DisplacementBand(model).nearest_mm(temperature_c, displacement_mm))


def moving_reference(from_mm: float, to_mm: float, speed_mm_per_s: float) -> Reference:
    """Return a reference that moves from `from_mm` to `to_mm` with at most `speed_mm_per_s`, and then stays.

    `scored_from_s` of the reference is the duration of the move.
    """
    return constant_reference(to_mm).with_approach(from_mm, PEAK * abs(to_mm - from_mm) / speed_mm_per_s)
