"""The tuning in force, the history of tunings, and the comparison of two tunings."""

from __future__ import annotations

from smadrive.control.controllers.swappable import SwappableController
from smadrive.measurement import DisplacementFrom
from smadrive.tuning.builder.build import Built
from smadrive.tuning.session.changes.comparison import Comparison
from smadrive.tuning.session.changes.history import History
from smadrive.tuning.tuning import Tuning


class Tunings:
    """The tuning in force, the history and the comparison. They change only between two ticks."""

    def __init__(self, first: Tuning) -> None:
        self.in_force = first
        self.history = History(first)
        self.comparison = Comparison()

    def displacement_from(self) -> DisplacementFrom:
        """Return the source of the displacement of the tuning in force."""
        return self.in_force.displacement_from

    def put(self, built: Built, live: SwappableController | None) -> None:
        """Put a built tuning in force. If the loop runs, the tuning's controller takes over."""
        self.in_force = built.tuning
        if live is not None and built.controller is not None and built.reference is not None:
            live.swap(built.controller, built.reference)

    def push(self, built: Built, live: SwappableController | None, now_s: float) -> None:
        """Put a built tuning in force as a change that can be undone."""
        self.put(built, live)
        self.history.push(built.tuning, now_s)

    def end_comparison(self) -> None:
        """End the comparison, and return to the tuning that was in force before it."""
        self.comparison.stop()
        self.in_force = self.history.now
