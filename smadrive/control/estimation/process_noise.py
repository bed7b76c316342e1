"""The process noise of the observer: how fast its model may become wrong, in calm air and in a disturbance."""

from __future__ import annotations

from typing import NamedTuple


class ProcessNoise(NamedTuple):
    """The errors of the model: standard deviations after one second.

    wire_c    error of the wire temperature, K
    drift_c   drift of the unexplained power, divided by h A, K
    shift_c   drift of the transformation, K
    phase     error of the hysteresis model, as a share of the travel
    """

    wire_c: float
    drift_c: float
    shift_c: float
    phase: float


class ProcessNoises(NamedTuple):
    """The process noise in calm air and in a disturbance.

    With more drift in a disturbance the observer would follow a draft, but also the noise, faster.
    """

    calm: ProcessNoise
    disturbed: ProcessNoise


PRECISE = ProcessNoises(ProcessNoise(0.015, 0.2, 0.05, 0.003), ProcessNoise(0.1, 20.0, 3.0, 0.003))
"""The process noise without a displacement, and for a precise displacement, as of a sensor."""

NOISY = ProcessNoises(ProcessNoise(0.015, 0.05, 0.02, 0.0005), PRECISE.disturbed._replace(phase=0.03))
"""The process noise for a noisy displacement, as that by the resistance.

In calm air the filter averages it over seconds, and model errors cancel in part. In a disturbance the phase may be
wrong by more, because a changed load may move the wire where the model expects no movement. A precise displacement
shows such a movement in any case, and a larger error of the phase would only hide the shift.
"""
