"""The tuning session: it measures or controls the wire, and handles the requests of the page at every tick.

When the session is idle, the heater is off and the wire is measured. A request to arm starts one run of the control
loop, which lasts until OFF or until a fault. The controller may be replaced between two ticks. The loop checks OFF
before every exchange. The builder process builds and checks models. The loop never waits for the page or the builder
(see channel.py).
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace

from smadrive.control.controllers.interface import Command
from smadrive.control.controllers.source_events import SourceEvents
from smadrive.control.controllers.swappable import SwappableController
from smadrive.control.loop import Tick, TickHandler
from smadrive.control.references.holding import holding_reference, resting_caveats
from smadrive.control.references.reference import Reference
from smadrive.errors import DataError, SmadriveError
from smadrive.measurement import Measurement
from smadrive.rig.rig import Rig
from smadrive.rig.supervision import WireChecks
from smadrive.runs.health.assessment import health_lines
from smadrive.runs.run_log import TickRecorder
from smadrive.runs.session_record import session_ended_event
from smadrive.safety.arming_checks import check_thermocouple
from smadrive.safety.shutdown import ShutdownOutcome, ends_safe, off_text, shutdown_of
from smadrive.stream.samples import row_of
from smadrive.tuning.builder.build import ModelBuilder, tuned_controller
from smadrive.tuning.link.channel import MESSAGES_PER_TICK, DriverEnd
from smadrive.tuning.session.adaptation_runner import AdaptationRunner, impossible_with
from smadrive.tuning.session.arming import Arming
from smadrive.tuning.session.changes.change_queue import ChangeQueue
from smadrive.tuning.session.changes.tunings import Tunings
from smadrive.tuning.session.idle import Idle
from smadrive.tuning.session.modes import Mode
from smadrive.tuning.session.reference_catalogue import ReferenceCatalogue
from smadrive.tuning.session.request_handler import RequestHandler
from smadrive.tuning.session.session_log import SessionLog
from smadrive.tuning.session.state import SessionState
from smadrive.tuning.session.status import STATUS_S, Status
from smadrive.tuning.tuning import Tuning
from smadrive.wire.health.drift import DRIFTED, WireHealth
from smadrive.wire.health.expected_rest import ExpectedRest
from smadrive.wire.wire_properties import WireProperties


class TuningSession:
    """A session with one rig, one wire and one page.

    `references` are the references that a page can start, by their names (see ReferenceCatalogue). `record` is
    called with every tick. `recorder` writes the log of the session; if it is None, there is no log. A jump of the
    resistance at rest away from `expected` is a fault.
    """

    def __init__(
        self,
        rig: Rig,
        tuning: Tuning,
        wire: WireProperties,
        references: Mapping[str, Reference],
        channel: DriverEnd,
        builder: ModelBuilder,
        record: TickHandler,
        recorder: TickRecorder | None = None,
        expected: ExpectedRest | None = None,
    ) -> None:
        self._rig = rig
        self._wire = wire
        self._usable = replace(wire, resistance=rig.usable(wire.wire_model(tuning.model)).resistance)
        self._expected = expected
        self._channel = channel
        self._record = record
        self._references = ReferenceCatalogue(references)
        self.tunings = Tunings(tuning)
        self._change_queue = ChangeQueue(self.tunings, builder, self._references.path, rig.config, self._usable)
        noise_c = wire.balance.assumed_noise_c(rig.config.feedback.noise_c)
        self._adaptation = AdaptationRunner(tuning, wire.balance, rig.period_s, noise_c)
        self._log = SessionLog(recorder, wire)
        self._status = Status(rig, self._references.names, wire, self._log)
        self._state = SessionState(rig, channel, self.tunings, self._status, rig.clock.now_s())
        self._idle = Idle(rig, self._status)
        self._arming = Arming(self._state)
        acting = self._idle, self._arming, self._adaptation, self._change_queue
        self._requests = RequestHandler(self._state, *acting, wire)
        self._is_served = False
        self._publish()

    @property
    def mode(self) -> Mode:
        """The present mode."""
        return self._state.mode

    def note_health(self, health: WireHealth) -> None:
        """Show the health of the wire on the pages: as an event, and as a warning if the wire has drifted."""
        self._state.report(f"wire: {'; '.join(health_lines(health))}")
        self._status.wire_warning = str(health) if health.verdict in DRIFTED else None
        self._publish()

    def run(self) -> None:
        """Run until the process is interrupted. DataError if the log cannot be written. No request ends the session."""
        try:
            with ends_safe(self._rig.heater.enter_safe_state):
                while True:
                    self._wait()
                    self._heat()
        except BaseException as error:
            self._end(shutdown_of(error))
            raise

    def _end(self, outcome: ShutdownOutcome | None) -> None:
        """Publish the end. It says whether the devices have confirmed the safe state."""
        self._status.end_session(confirmed=outcome is not None and outcome.confirmed)
        self._publish()
        self._note()
        self._state.report(session_ended_event(confirmed=self._status.is_safe))
        with suppress(DataError):  # this error is reported when the log is closed
            self._log.write_events()

    def _note(self) -> None:
        """Add a change of the mode or of the tuning in force to the log."""
        self._log.note(self._state.now_s, self._state.mode, self.tunings.in_force)

    def _wait(self) -> None:
        """Measure with the heater off, until a request to arm waits and no change is queued or being built."""
        clock, period_s = self._rig.clock, self._rig.period_s
        due_s = clock.now_s()
        while not self._may_heat():
            clock.sleep_until(due_s)
            late_s = clock.now_s() - due_s
            measurement = self._idle.sample(self._state.now_s)
            if measurement is not None:
                self._take(Tick(measurement.time_s - self._state.began_s, late_s, measurement, Command(0.0)))
            else:
                self._log.write_events()
            self._serve()
            due_s = max(due_s + period_s, clock.now_s())

    def _may_heat(self) -> bool:
        self._arming.expire()
        return self._arming.is_waiting and not self._change_queue.is_busy

    def _heat(self) -> None:
        """Run the control loop once. The first tick of the loop answers the request to arm."""
        self._status.clear_fault()
        self._state.stop_requested, self._is_served = False, True
        try:
            with ends_safe(self._rig.heater.enter_safe_state):
                self._drive(self._hold(self._rig.heater.exchange(0.0)))
            self._state.report(off_text(confirmed=True))
        except SmadriveError as error:
            if error is self._log.failure:
                raise
            self._fail(error)
        finally:
            self._state.live = None
            self._change_queue.cancel()

    def _hold(self, measurement: Measurement) -> SwappableController:
        """Return a controller that holds the wire at its displacement. SafetyError when the temperature is unknown.

        ConfigError when the source of the displacement is impossible.
        """
        check_thermocouple(measurement)
        tuning = self.tunings.in_force
        wire, source = self._wire.wire_model(tuning.model), tuning.displacement_from
        self._state.warn(self._rig.check_sensing(wire, source, measurement.temperature_c))
        self._state.warn(resting_caveats(tuning.model, measurement, source))
        reference = holding_reference(tuning.model, measurement, source)
        controller = tuned_controller(tuning, reference, self._rig.config, self._usable)
        return SwappableController(controller, reference, self._serve)

    def _drive(self, live: SwappableController) -> None:
        """Run the loop until a stop is requested or a fault ends it."""
        self._state.live, self._state.source_events = live, SourceEvents()
        tuning = self.tunings.in_force
        if tuning.feedback.adapt and not self._adaptation.is_on:
            if impossible := impossible_with(tuning):
                self._state.report(f"not adapted: {impossible}")
            else:
                self._adaptation.switch(True, tuning)
        wire = self._wire.wire_model(tuning.model)
        checks = WireChecks(wire, self._expected, self.tunings.displacement_from, live.trusts_sensor)
        self._rig.drive(live, self._wire.balance, self._take, checks, self._stop_requested)

    def _fail(self, error: SmadriveError) -> None:
        """Report `error` as the fault. The rig stays connected, so the page shows whether the fault is removed."""
        self._status.fail(self._state.now_s, error)
        if not self._status.is_safe:
            self._idle.make_safe()
        self._arming.settle(self._status.fault)
        if (outcome := shutdown_of(error)) is not None:
            outcome.obey_signals()

    def _take(self, tick: Tick) -> None:
        """Send a tick to the page, the comparison, the adaptation, the function `record` and the log."""
        measurement = tick.measurement
        self._channel.append(row_of(tick, self._state.began_s))
        self._status.measurement = measurement
        self._change_queue.comparison.score(tick.command.setpoint_mm - tick.reached_mm)
        self._state.note_source(tick.command)
        self._adapt(tick)
        self._record(tick)
        self._log.tick(tick, measurement.time_s - self._state.began_s)

    def _adapt(self, tick: Tick) -> None:
        live = self._state.live
        is_heating, source = live is not None and not tick.tripped, None if live is None else live.source
        ended = self._adaptation.update(tick, self.tunings.in_force, source, is_heating=is_heating)
        if ended is not None:
            self._state.report(ended)
        adaptation = self._adaptation.due(self._state.now_s, is_heating=is_heating)
        if adaptation is not None and self._change_queue.adapt(adaptation):
            self._adaptation.taken()

    def _serve(self) -> None:
        """Handle OFF, requests of the page and results of the builder. Publish the status if `STATUS_S` has passed."""
        self._is_served = True
        if self._state.live is not None and self._arming.is_waiting:
            self._state.report("armed, holding")
            self._arming.settle(None)
        self._requests.check_off()
        for message in self._channel.received(MESSAGES_PER_TICK):
            self._requests.receive(message)
        for event in self._change_queue.update(self._state.live, self._state.now_s):
            self._state.report(event)
        for request, refused in self._change_queue.answers():
            self._state.answer(request, refused)
        self._note()
        if self._state.now_s - self._published_s >= STATUS_S:
            self._publish()

    def _publish(self) -> None:
        self._published_s = self._state.now_s
        self._state.publish(adapts=self._adaptation.is_on)

    def _stop_requested(self) -> bool:
        """Return True if the loop must end. The loop calls this before each tick.

        Normally the controller calls `_serve` in each tick. A tick without a measurement skips the controller: then
        call `_serve` here.
        """
        if not self._is_served:
            self._serve()
        self._is_served = False
        self._requests.check_off()
        return self._state.stop_requested
