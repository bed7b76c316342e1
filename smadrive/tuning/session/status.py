"""The status: all data that a page shows, except the samples, as one JSON document."""

from __future__ import annotations

import time
from collections import deque
from math import isfinite
from typing import Any

from smadrive.control.controllers.swappable import SwappableController
from smadrive.errors import TripError
from smadrive.hysteresis.turning_points import Memory
from smadrive.measurement import Measurement
from smadrive.rig.rig import Rig
from smadrive.safety.shutdown import shutdown_of
from smadrive.stream.feed import common_status
from smadrive.stream.published_state import PublishedEnd, PublishedMode
from smadrive.tuning.session.changes.comparison import Comparison
from smadrive.tuning.session.changes.tunings import Tunings
from smadrive.tuning.session.modes import Mode, refused_acts
from smadrive.tuning.session.session_log import SessionLog
from smadrive.tuning.tuning import Tuning
from smadrive.wire.wire_model import travel_mm
from smadrive.wire.wire_properties import WireProperties

STATUS_S = 0.1
"""The status is published with this period."""

MAX_EVENTS = 40

MAX_EVENT_LENGTH = 400
"""Largest length of an event in characters. The status must not exceed the `STATUS_BYTES` of the shared memory."""

_PUBLISHED = {
    Mode.HOLDING: PublishedMode.HOLDING,
    Mode.TRACKING: PublishedMode.TRACKING,
    Mode.COMPARING: PublishedMode.TRACKING,
}
"""The `mode` in the status, for each session mode in which the heater is on."""


class Status:
    """Collects events, the fault that is not cleared yet, a lost connection and the last measurement.

    fault           text of the fault that ended the last run of the loop; None without one, or if it was cleared
    latched         latched trip, also of an earlier session; None without one
    lost            error of a device that does not answer; None if all answer
    wire_warning    says how far the wire has drifted; None for a wire without drift
    is_safe         False after an attempt to switch the heater off has failed, until an attempt succeeds
    end             None until the session ends; then it says if the devices have confirmed the safe state
    """

    def __init__(self, rig: Rig, references: list[str], wire: WireProperties, log: SessionLog) -> None:
        self._log = log
        self.fault: str | None = None
        self.fault_type: str | None = None
        self.fault_s: float | None = None
        self._latch = rig.latch
        self.latched = rig.latch.read()
        self.lost: str | None = None
        self.wire_warning: str | None = None
        self.is_safe = True
        self.end: PublishedEnd | None = None
        self.measurement: Measurement | None = None
        self.events: deque[tuple[float, str]] = deque(maxlen=MAX_EVENTS)
        self._config, self._identities = rig.config, rig.identities
        self._fixed = {"began_unix_s": time.time(), "references": references}
        self._wire = wire
        self._described: tuple[Tuning, dict[str, Any]] | None = None

    def add_event(self, time_s: float, event: str) -> None:
        """Add an event, also to the log. For the pages, a long text is cut to `MAX_EVENT_LENGTH`."""
        self._log.event(time_s, event)
        if len(event) > MAX_EVENT_LENGTH:
            event = event[: MAX_EVENT_LENGTH - 1] + "…"
        self.events.append((round(time_s, 2), event))

    def clear_fault(self) -> None:
        """Remove the fault, its type and its time, and read the trip latch again."""
        self.fault = self.fault_type = self.fault_s = None
        self.latched = self._latch.read()

    def fail(self, time_s: float, error: BaseException) -> None:
        """Store `error` with its notes as the fault. `is_safe` becomes True, or False if the shutdown failed."""
        outcome, self.latched = shutdown_of(error), self._latch.read()
        self.is_safe = outcome is None or outcome.confirmed
        text = error.what if isinstance(error, TripError) else str(error)  # the page has a button that clears the trip
        self.fault = " — ".join([text, *getattr(error, "__notes__", ())])
        self.fault_type = type(error).__name__
        self.fault_s = time_s
        self.add_event(time_s, self.fault)

    def end_session(self, *, confirmed: bool) -> None:
        """Store the end of the session. `confirmed`: the devices have confirmed the safe state, so none is lost."""
        self.is_safe, self.end = confirmed, PublishedEnd.switched_off(confirmed=confirmed)
        if confirmed:
            self.lost = None

    def document(
        self, mode: Mode, tunings: Tunings, live: SwappableController | None, *, adapts: bool
    ) -> dict[str, Any]:
        """Return the status as values that JSON can hold. `live` is the controller that runs, or None."""
        published = _PUBLISHED.get(mode, PublishedMode.switched_off(confirmed=self.is_safe))
        memory, source = (None, None) if live is None else (live.memory, live.source)
        return {
            **common_status(self._config, self._identities, self.measurement, published),
            **self._fixed,
            "refused_acts": list(refused_acts(mode)),
            "end": self.end,
            "fault": self.fault,
            "fault_type": self.fault_type,
            "fault_s": self.fault_s,
            "latched": self.latched,
            "lost": self.lost,
            "wire_warning": self.wire_warning,
            "tuning": self._tuning(tunings.in_force),
            "undo": tunings.history.undo_name,
            "redo": tunings.history.redo_name,
            "comparison": _comparison(tunings.comparison),
            "adapts": adapts,
            "displacement_in_force": None if source is None else source.in_force.value,
            "cooling": None if live is None else _rounded(live.command.cooling, 2),
            "shift_c": None if live is None else _rounded(live.command.shift_c, 1),
            "turning_points": None if memory is None else _turning_points(memory),
            "events": list(self.events),
        }

    def _tuning(self, tuning: Tuning) -> dict[str, Any]:
        """Return the description of the tuning in force. It is computed once for each tuning."""
        if self._described is None or self._described[0] is not tuning:
            document = {
                "wire": self._wire.identified(tuning.model).text(),
                "shape": tuning.shape._asdict(),
                "feedback": tuning.feedback.model_dump(),
                "displacement_from": tuning.displacement_from.value,
                "change": tuning.change,
                "caveats": list(tuning.caveats),
                "travel_mm": travel_mm(tuning.model),
                "invertible_percent": 100.0 * tuning.model.certificate().invertible_share,
            }
            self._described = tuning, document
        return self._described[1]


def _rounded(value: float, digits: int) -> float | None:
    return round(value, digits) if isfinite(value) else None


def _turning_points(memory: Memory) -> dict[str, Any]:
    return {"temperatures_c": [round(turn, 2) for turn in memory.turns], "dropped": memory.dropped}


def _comparison(comparison: Comparison) -> dict[str, Any]:
    return {
        "on": comparison.is_on,
        "turn": comparison.turn,
        "slots": {slot: tuning.change for slot, tuning in comparison.slots.items()},
        "scores": {slot: [score.mean_percent, len(score.cycles)] for slot, score in comparison.scores.items()},
    }
