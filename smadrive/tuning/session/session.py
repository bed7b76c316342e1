"""The control side of the tuning page: a rig that is idle or heats, and at every tick a look at what the page asks.

Idle, the wire is measured and the heater is off. Armed, one run of the control loop lasts until somebody switches off
or the supervisor trips; its controller is exchanged between two ticks. The loop looks at OFF before every exchange.
Building and checking models takes longer; a workshop beside the loop does it. The page is never waited for (channel).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import isfinite

from smadrive.control.controllers.temperature import Command
from smadrive.control.loop import Tick
from smadrive.control.references.reference import Reference
from smadrive.errors import ConfigError, SmadriveError
from smadrive.rig.rig import Rig
from smadrive.safety.shutdown import ends_safe, shutdown_of
from smadrive.safety.supervisor import check_thermocouple
from smadrive.tuning.builder.builder import ModelBuilder, tuned_controller
from smadrive.tuning.link.channel import MESSAGES_PER_TICK, ControlEnd, row_of
from smadrive.tuning.link.messages import (
    Adapt,
    AnyRequest,
    Arm,
    ClearFaults,
    Compare,
    Driving,
    Note,
    Off,
    Request,
    Step,
    numbered,
    parse_request,
)
from smadrive.tuning.session.adaptation_runner import AdaptationRunner
from smadrive.tuning.session.arming import Arming
from smadrive.tuning.session.change_queue import ChangeQueue
from smadrive.tuning.session.idle import Idle
from smadrive.tuning.session.off_path import OffPath, front_silent
from smadrive.tuning.session.reference_catalogue import ReferenceCatalogue
from smadrive.tuning.session.status import STATUS_S, Status
from smadrive.tuning.session.swappable_controller import SwappableController
from smadrive.tuning.tuning import Tuning
from smadrive.wire.heat_balance import HeatBalance


class TuningSession:
    """One rig, one wire, one page. `references` have names (see ReferenceCatalogue); every tick goes to `record`."""

    def __init__(
        self,
        rig: Rig,
        tuning: Tuning,
        balance: HeatBalance,
        references: Mapping[str, Reference],
        channel: ControlEnd,
        workshop: ModelBuilder,
        record: Callable[[Tick], None],
    ) -> None:
        self._rig = rig
        self._balance = balance
        self._offered = ReferenceCatalogue(references)
        self._channel = channel
        self._record = record
        self.bench = ChangeQueue(self._offered.path, rig.config, balance, tuning, workshop)
        self._live: SwappableController | None = None
        self._adapting = AdaptationRunner(tuning, balance, rig.period_s, rig.config.feedback.noise_c)
        self._status = Status(rig, self._offered.names, balance, self.bench)
        self._began_s = rig.clock.now_s()
        self._idle = Idle(rig, self._status)
        self._arming = Arming(self._answer)
        self._off_path = OffPath(channel)
        self._stops = self._is_served = False
        self._publish()

    def run(self) -> None:
        """Until interrupted: nothing that the page does ends this."""
        try:
            while True:
                self._wait()
                self._heat()
        finally:
            self._end()

    def _end(self) -> None:
        """Switch off, and leave word for the pages whether that is confirmed."""
        try:
            self._rig.heater.enter_safe_state()
            self._status.is_safe, self._status.end = True, "off"
        except Exception:  # noqa: BLE001  (whatever it is: the heater is then not confirmed off)
            self._status.is_safe, self._status.end = False, "unconfirmed"
        self._publish()

    @property
    def is_heating(self) -> bool:
        """Whether the control loop runs."""
        return self._live is not None

    @property
    def is_tracking(self) -> bool:
        """Whether it follows a reference."""
        return self._live is not None and self._live.reference.endless

    @property
    def _now_s(self) -> float:
        return self._rig.clock.now_s() - self._began_s

    def _wait(self) -> None:
        """Measure with the heater off, until armed and nothing is on its way into force any more."""
        clock, period_s = self._rig.clock, self._rig.period_s
        due_s = clock.now_s()
        while not self._may_heat():
            clock.sleep_until(due_s)
            late_s = clock.now_s() - due_s
            measurement = self._idle.sample(self._now_s)
            if measurement is not None:
                self._take(Tick(measurement.time_s - self._began_s, late_s, measurement, Command(0.0)))
            self._serve()
            due_s = max(due_s + period_s, clock.now_s())

    def _may_heat(self) -> bool:
        self._arming.expire(self._now_s)
        return self._arming.waits and not self.bench.is_busy

    def _heat(self) -> None:
        """One run of the control loop, holding the wire where it is to begin with; told as begun by its first tick."""
        self._status.clear_fault()
        self._stops, self._is_served = False, True
        try:
            with ends_safe(self._rig.heater.enter_safe_state):
                measured = self._rig.heater.exchange(0.0)
                check_thermocouple(measured)
                hold = self._offered.hold(self.bench.in_force, measured)
                controller = tuned_controller(self.bench.in_force, hold, self._rig.config, self._balance)
                self._live = SwappableController(controller, hold, self._serve)
                if self.bench.in_force.feedback.adapt and not self._adapting.is_on:
                    self._adapting.switch(True, self.bench.in_force)
                self._rig.drive(self._live, self._balance, self._take, self.bench.in_force.model, self._stop_requested)
            self._status.tell(self._now_s, "heater off, confirmed")
        except SmadriveError as error:
            self._failed(error)
        finally:
            self._live = None
            self.bench.forget()

    def _failed(self, error: SmadriveError) -> None:
        """Tell the fault; the rig stays connected, so that its remedy can be seen to work."""
        self._status.fail(self._now_s, error)
        if not self._status.is_safe:
            self._idle.make_safe()
        self._arming.settle(self._status.fault)
        if (outcome := shutdown_of(error)) is not None:
            outcome.obey_signals()

    def _take(self, tick: Tick) -> None:
        """Where every tick goes: to the page, and to the log."""
        measurement, command = tick.measurement, tick.command
        self._channel.append(row_of(tick, self._began_s))
        self._status.measured = measurement
        is_measured = isfinite(measurement.displacement_mm)
        self.bench.score(command.setpoint_mm - (measurement.displacement_mm if is_measured else command.estimated_mm))
        self._adapt(tick)
        self._record(tick)

    def _adapt(self, tick: Tick) -> None:
        ended = self._adapting.update(tick, self.bench.in_force, is_heating=self.is_heating)
        if ended is not None:
            self._status.tell(self._now_s, ended)
        adaptation = self._adapting.due(self._now_s, is_heating=self.is_heating)
        if adaptation is not None and self.bench.adapt(adaptation):
            self._adapting.taken()

    def _serve(self) -> None:
        """What the page has asked since the last tick, what the workshop has finished, and the status for the page."""
        self._is_served = True
        if self._live is not None and self._arming.waits:
            self._status.tell(self._now_s, "armed, holding")
            self._arming.settle(None)
        self._heed_off()
        for message in self._channel.received(MESSAGES_PER_TICK):
            self._receive(message)
        for event in self.bench.turn(self._live, self._now_s):
            self._status.tell(self._now_s, event)
        for request, refused in self.bench.answers():
            self._answer(request, refused)
        if self._now_s - self._published_s >= STATUS_S:
            self._publish()

    def _publish(self) -> None:
        self._published_s = self._now_s
        self._channel.publish(self._status.document(self._live, adapts=self._adapting.is_on))

    def _heed_off(self) -> None:
        if self._channel.off_requested():
            self._off()
        if self._off_path.is_silent(self._now_s):
            self._stop_without_front()

    def _stop_without_front(self) -> None:
        """Nothing heats while OFF on the page has no effect."""
        silent = front_silent()
        self._arming.settle(str(silent))
        if self._live is not None and not self._stops:
            self._status.fail(self._now_s, silent)
            self._stops = True

    def _stop_requested(self) -> bool:
        """Whether the page has asked to switch off; serves it where a lost exchange left that undone."""
        if not self._is_served:
            self._serve()
        self._is_served = False
        self._heed_off()
        return self._stops

    def _receive(self, message: bytes) -> None:
        self._heed_off()  # an OFF that was known when this was asked has come before it
        try:
            self._do(parse_request(message))
        except SmadriveError as error:
            asked = numbered(message)
            if asked is None:
                self._status.tell(self._now_s, f"refused: {error}")
            self._answer(asked, str(error))

    def _do(self, request: AnyRequest) -> None:
        """Do at once what can be done at once; the rest goes to the workbench."""
        if isinstance(request, Driving) and request.offs != self._channel.offs:
            raise ConfigError("OFF was pressed after this: press again")
        match request:
            case Off():
                self._off()
            case Arm():
                self._arm(request)
                return
            case ClearFaults():
                self._clear()
            case Adapt(on=on):
                self.bench.check_compares_nothing()
                self._adapting.switch(on, self.bench.in_force)
                self._status.tell(self._now_s, f"adaptation {'on' if on else 'off'}")
            case Note(text=text):
                self._status.tell(self._now_s, text)
            case _:
                if isinstance(request, Step):
                    self._adapting.switch(False, self.bench.in_force)
                if isinstance(request, Compare) and request.on and self._adapting.is_on:
                    raise ConfigError("the adaptation would change what is compared: end it first")
                self.bench.add(request, self._live)
                return
        self._answer(request, None)

    def _arm(self, request: Arm) -> None:
        if self._live is not None:
            raise ConfigError("it is armed already")
        if self._off_path.is_silent(self._now_s):
            raise front_silent()
        self._arming.begin(request, self._now_s)

    def _off(self) -> None:
        self._arming.settle("the heater was switched off meanwhile")
        self._status.tell(self._now_s, "OFF")
        if self._live is None:
            self._idle.make_safe()
        else:
            self._stops = True

    def _clear(self) -> None:
        if self._live is not None:
            raise ConfigError("switch off before clearing faults")
        self._rig.clear_faults()
        self._status.clear_fault()
        self._status.tell(self._now_s, "faults cleared")

    def _answer(self, request: Request | None, refused: str | None) -> None:
        if request is not None:
            self._channel.send({"number": request.number, "refused": refused})
            if refused:
                self._status.tell(self._now_s, f"refused: {refused}")
