"""The state that the parts of a tuning session share, and the mode that follows from it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

from smadrive.control.controllers.interface import Command
from smadrive.control.controllers.source_events import SourceEvents
from smadrive.control.controllers.swappable import SwappableController
from smadrive.measurement import DisplacementFrom
from smadrive.rig.rig import Rig
from smadrive.tuning.link.channel import DriverEnd
from smadrive.tuning.link.requests import Arm, PageRequest
from smadrive.tuning.session.changes.tunings import Tunings
from smadrive.tuning.session.modes import Mode
from smadrive.tuning.session.status import Status


@dataclass
class SessionState:
    """The shared state of a session.

    began_s               time of the clock at the start, s
    live                  controller while the control loop runs, otherwise None
    arm_request           request to arm that waits, or None
    arm_requested_s       time since the session began at which this request arrived, s
    stop_requested        if True, the loop ends before its next exchange
    source_events         the events about the source of the displacement, since `live` began
    """

    rig: Rig
    channel: DriverEnd
    tunings: Tunings
    status: Status
    began_s: float
    live: SwappableController | None = None
    arm_request: Arm | None = None
    arm_requested_s: float = 0.0
    stop_requested: bool = False
    source_events: SourceEvents = field(default_factory=SourceEvents)

    @property
    def now_s(self) -> float:
        """The time since the session began, in seconds."""
        return self.rig.clock.now_s() - self.began_s

    @property
    def mode(self) -> Mode:
        """The mode of the session."""
        if self.status.end is not None:
            return Mode.ENDED
        if (live := self.live) is not None:
            return self._heating_mode(live)
        if self.arm_request is not None:
            return Mode.ARMING
        return Mode.IDLE if self.status.fault is None else Mode.TRIPPED

    def _heating_mode(self, live: SwappableController) -> Mode:
        if self.tunings.comparison.is_on:
            return Mode.COMPARING
        return Mode.TRACKING if live.reference.endless else Mode.HOLDING

    def report(self, event: str) -> None:
        """Add an event, with the present time, to the events that all pages show."""
        self.status.add_event(self.now_s, event)

    def warn(self, warnings: Iterable[str]) -> None:
        """Report each of these warnings as an event."""
        for warning in warnings:
            self.report(f"warning: {warning}")

    def note_source(self, command: Command) -> None:
        """Add an event if the source of the displacement has changed with this command of the control loop."""
        if self.live is None:
            return
        source = self.live.source
        by_sensor = source is not None and source.source is DisplacementFrom.SENSOR
        for event in self.source_events.update(command, by_sensor=by_sensor):
            self.report(event)

    def answer(self, request: PageRequest | None, refused: str | None) -> None:
        """Send the answer to `request`; do nothing if it is None. `refused` is the reason for a refusal, or None.

        A refusal is also added to the events.
        """
        if request is not None:
            self.channel.send({"number": request.number, "refused": refused})
            if refused:
                self.report(f"refused: {refused}")

    def publish(self, *, adapts: bool) -> None:
        """Publish the status to the pages."""
        self.channel.publish(self.status.document(self.mode, self.tunings, self.live, adapts=adapts))
