"""Runs a comparison: after each cycle of the reference, the tuning in the other slot (A or B) drives the wire."""

from __future__ import annotations

from collections.abc import Callable
from math import nan

from smadrive.control.controllers.swappable import SwappableController
from smadrive.errors import ConfigError
from smadrive.tuning.builder.build import Built
from smadrive.tuning.session.changes.jobs import Job, TurnJob
from smadrive.tuning.session.changes.tunings import Tunings
from smadrive.wire.wire_model import travel_mm


class ComparisonRunner:
    """Lets the tunings in slots A and B drive the wire in turn. `queue` gets the jobs that build controllers."""

    def __init__(self, tunings: Tunings, queue: Callable[[Job], None]) -> None:
        self._tunings = tunings
        self._comparison = tunings.comparison
        self._queue = queue
        self._cycle = 0
        self._stroke_mm = nan
        self._next: Built | None = None

    def start(self, live: SwappableController) -> None:
        """Begin the comparison at the end of the running cycle.

        ConfigError when a slot is empty, when both slots hold the same tuning, or when too many jobs wait.
        """
        self._comparison.start()
        self._cycle, self._next = live.reference.cycle(live.reference_s), None
        self._stroke_mm = travel_mm(self._comparison.slot("A").model).stroke_mm
        try:
            self._prepare_next()
        except ConfigError:
            self._comparison.stop()
            raise

    def score(self, error_mm: float) -> None:
        """Add the tracking error of one tick, in mm, to the score of the running cycle.

        Both tunings are scored in percent of the stroke of A, so that equal errors have equal scores.
        """
        if self._comparison.is_on:
            self._comparison.sample(error_mm, self._stroke_mm)

    def update(self, live: SwappableController) -> str:
        """After a complete cycle, score the cycle. Let the other slot's tuning drive if its controller is ready.

        Return the text of the event to report; it is empty within a cycle, and if no comparison runs.
        """
        if not self._comparison.is_on:
            return ""
        cycle = live.reference.cycle(live.reference_s)
        if cycle == self._cycle:
            return ""
        self._cycle = cycle
        if self._next is None:
            return self._comparison.end_cycle(self._comparison.turn)
        event = self._comparison.end_cycle(self._comparison.next_turn)
        self._tunings.put(self._next, live)
        self._next = None
        self._prepare_next()
        return event

    def _prepare_next(self) -> None:
        tuning = self._comparison.slot(self._comparison.next_turn)
        self._queue(TurnJob(None, tuning=tuning, ready=self._keep))

    def _keep(self, built: Built) -> None:
        self._next = built
