"""The log of a session: the ticks, the events, the modes, and the model of every tuning that was put in force.

OFF and other requests write nothing to the file: their events wait in memory until `tick` or `write_events` writes
them. Only these two methods raise an error when the log cannot be written. This error ends the session.
"""

from __future__ import annotations

from hashlib import sha256

from smadrive.control.loop import Tick
from smadrive.errors import DataError
from smadrive.runs.run_log import TickRecorder
from smadrive.runs.session_record import in_force_event, mode_event, model_events
from smadrive.tuning.session.modes import Mode
from smadrive.tuning.tuning import Tuning
from smadrive.wire.wire_properties import WireProperties


class SessionLog:
    """Collects the events of a session, and writes them with its ticks. It writes nothing if `recorder` is None.

    `failure` is the error that ended the writing, or None.
    """

    def __init__(self, recorder: TickRecorder | None, wire: WireProperties) -> None:
        self._recorder = recorder
        self._wire = wire
        self._events: list[tuple[float, str]] = []
        self._last_s = float("-inf")
        self._mode: Mode | None = None
        self._tuning: Tuning | None = None
        self._models: dict[bytes, int] = {}
        self.failure: DataError | None = None

    def event(self, time_s: float, text: str) -> None:
        """Add an event, which the next `tick` or `write_events` writes."""
        if self._recorder is not None and self.failure is None:
            self._events.append((time_s, text))

    def note(self, time_s: float, mode: Mode, tuning: Tuning) -> None:
        """Add an event for each of mode and tuning in force that has changed since the last call."""
        if mode is not self._mode:
            self._mode = mode
            self.event(time_s, mode_event(mode.value))
        if tuning is not self._tuning and self._recorder is not None:
            self._tuning = tuning
            self._note_tuning(time_s, tuning)

    def tick(self, tick: Tick, time_s: float) -> None:
        """Write a tick at `time_s`, the time since the session began. DataError when the log cannot be written."""
        if self._recorder is None:
            return
        try:
            self._write_events(self._recorder)
            if time_s > self._last_s:
                self._last_s = time_s
                self._recorder.tick(tick._replace(time_s=time_s))
        except DataError as error:
            self.failure = error
            raise

    def write_events(self) -> None:
        """Write the events that wait. DataError when the log cannot be written."""
        if self._recorder is None or self.failure is not None:
            return
        try:
            self._write_events(self._recorder)
        except DataError as error:
            self.failure = error
            raise

    def _write_events(self, recorder: TickRecorder) -> None:
        events, self._events = self._events, []
        for time_s, text in events:
            recorder.event(text, time_s)

    def _note_tuning(self, time_s: float, tuning: Tuning) -> None:
        """Add an event for the tuning in force. If its model is new to the log, first add the text of the model."""
        text = self._wire.identified(tuning.model).text()
        key = sha256(text.encode()).digest()
        if key not in self._models:
            self._models[key] = len(self._models) + 1
            for event in model_events(self._models[key], text):
                self.event(time_s, event)
        values = {
            **tuning.shape._asdict(),
            **tuning.feedback.model_dump(),
            "displacement_from": tuning.displacement_from.value,
        }
        self.event(time_s, in_force_event(tuning.change, self._models[key], values))
