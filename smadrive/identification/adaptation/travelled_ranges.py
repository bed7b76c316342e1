"""The ranges through which a wire has moved since the last check of the sensor: predicted and measured."""

from __future__ import annotations


class TravelledRanges:
    """The ranges of the predicted and the measured displacement since the last check, in strokes.

    The predicted range contains only the moves of the wire. A change of the prediction by learning is not travel.
    """

    def __init__(self, measured: float) -> None:
        self._measured = (measured, measured)
        self._moved = 0.0
        self._predicted = (0.0, 0.0)

    def add(self, measured: float, move: float) -> None:
        """Extend the ranges by one sample. `move` is the predicted move since the sample before."""
        self._moved += move
        self._measured = _extended(self._measured, measured)
        self._predicted = _extended(self._predicted, self._moved)

    @property
    def measured(self) -> float:
        """The measured travel in strokes."""
        return self._measured[1] - self._measured[0]

    @property
    def predicted(self) -> float:
        """The predicted travel in strokes."""
        return self._predicted[1] - self._predicted[0]


def _extended(ends: tuple[float, float], value: float) -> tuple[float, float]:
    return min(ends[0], value), max(ends[1], value)
