"""The process noise of the observer: how fast its model may become wrong, in calm air and in a disturbance."""

from __future__ import annotations

from typing import NamedTuple


class ProcessNoise(NamedTuple):
    """The errors of the heat balance: standard deviations after one second, K.

    `wire_c` is the error of the wire temperature, `drift_c` the drift of the unexplained power, divided by h A, and
    `shift_c` the drift of the transformation.
    """

    wire_c: float
    drift_c: float
    shift_c: float


CALM = ProcessNoise(0.015, 0.2, 0.05)
"""Process noise in calm air."""

DISTURBED = ProcessNoise(0.1, 20.0, 3.0)
"""Process noise in a disturbance. With more drift the observer would follow a draft, but also the noise, faster."""

PHASE_NOISE = 0.003
"""Error of the hysteresis model: standard deviation of the phase after one second."""

DISTURBED_PHASE_NOISE = 0.03
"""`PHASE_NOISE` in a disturbance: a changed load may move the wire where the model expects no movement."""

SLOW_PHASE_NOISE = 0.001
"""`PHASE_NOISE` for a noisier displacement: the filter averages it over seconds, and model errors cancel in part."""
