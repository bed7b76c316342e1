"""Handles the requests of the pages: checks each request against OFF and the mode, then does, queues or refuses it."""

from __future__ import annotations

from smadrive.errors import ConfigError, SafetyError, SmadriveError
from smadrive.measurement import DisplacementFrom
from smadrive.safety.arming_checks import REFUSED
from smadrive.safety.shutdown import UNCONFIRMED
from smadrive.tuning.link.requests import (
    Adapt,
    AnyRequest,
    Arm,
    ClearFaults,
    Compare,
    DrivingRequest,
    Keep,
    Note,
    Off,
    SetSource,
    Step,
    numbered,
    parse_request,
)
from smadrive.tuning.session.adaptation_runner import AdaptationRunner
from smadrive.tuning.session.arming import Arming
from smadrive.tuning.session.changes.change_queue import ChangeQueue
from smadrive.tuning.session.idle import Idle
from smadrive.tuning.session.modes import check_allowed
from smadrive.tuning.session.off_path import OffPath, front_silent
from smadrive.tuning.session.state import SessionState
from smadrive.wire.wire_properties import WireProperties


class RequestHandler:
    """Handles OFF, and the messages that arrive on the channel."""

    def __init__(
        self,
        state: SessionState,
        idle: Idle,
        arming: Arming,
        adaptation: AdaptationRunner,
        change_queue: ChangeQueue,
        wire: WireProperties,
    ) -> None:
        self._state = state
        self._idle = idle
        self._arming = arming
        self._adaptation = adaptation
        self._change_queue = change_queue
        self._wire = wire
        self._off_path = OffPath(state.channel)

    def check_off(self) -> None:
        """Stop the loop if an OFF was counted, or if OFF would have no effect because the front process is silent."""
        if self._state.channel.off_requested():
            self._off()
        if self._off_path.is_silent(self._state.now_s):
            self._stop_without_front()

    def receive(self, message: bytes) -> None:
        """Do, queue or refuse the request in `message`. An OFF that was counted before this call is done first."""
        self.check_off()
        try:
            self._do(parse_request(message))
        except SmadriveError as error:
            request = numbered(message)
            if request is None:
                self._state.report(f"refused: {error}")
            self._state.answer(request, str(error))

    def _do(self, request: AnyRequest) -> None:
        if isinstance(request, DrivingRequest) and request.offs != self._state.channel.offs:
            raise ConfigError("OFF was pressed after this click", cure="press again")
        check_allowed(request, self._state.mode)
        match request:
            case Arm():
                self._arm(request)
            case Off() | ClearFaults() | Adapt() | Note():
                self._do_at_once(request)
                self._state.answer(request, None)
            case _:
                self._queue(request)

    def _do_at_once(self, request: Off | ClearFaults | Adapt | Note) -> None:
        match request:
            case Off():
                self._off()
            case ClearFaults():
                self._state.rig.clear_faults()
                self._state.status.clear_fault()
                self._state.report("faults cleared")
            case Adapt(on=on):
                self._adaptation.switch(on, self._state.tunings.in_force)
                self._state.report(f"adaptation {'on' if on else 'off'}")
            case Note(text=text):
                self._state.report(text)

    def _queue(self, request: AnyRequest) -> None:
        if isinstance(request, Step):
            self._adaptation.switch(False, self._state.tunings.in_force)
        if isinstance(request, SetSource):
            self._check_source(request)
        if isinstance(request, Compare) and request.on and self._adaptation.is_on:
            raise ConfigError("the adaptation would change the compared tunings", cure="stop the adaptation first")
        self._change_queue.add(request, self._state.live)
        if isinstance(request, Keep):
            self._state.report(f"slot {request.slot} keeps the tuning after '{self._state.tunings.in_force.change}'")

    def _check_source(self, request: SetSource) -> None:
        """Report the warnings about a source of the displacement. ConfigError if the rig cannot use it."""
        wire = self._wire.wire_model(self._state.tunings.in_force.model)
        self._state.warn(self._state.rig.check_chosen(wire, request.displacement_from, self._leads_seen_c()))

    def _leads_seen_c(self) -> float:
        """Return the wire temperature, °C, for the check whether the resistance of the leads is known.

        The leads are measured on the cold wire at the start of a run, or with a displacement sensor during a run. So
        return the ambient temperature while a sensor is the source, else the measured temperature. While the heater is
        off, also return the ambient temperature: the check is repeated when the user arms.
        """
        live, measured = self._state.live, self._state.status.measurement
        by_sensor = live is None or live.source is None or live.source.source is DisplacementFrom.SENSOR
        return self._wire.balance.ambient_c if by_sensor or measured is None else measured.temperature_c

    def _arm(self, request: Arm) -> None:
        if self._off_path.is_silent(self._state.now_s):
            raise front_silent()
        if not self._state.status.is_safe:
            cure = "arm again when the page shows that the heater is off, or cut its supply"
            raise SafetyError(f"{REFUSED}: {UNCONFIRMED}", cure=cure)
        self._arming.begin(request)

    def _off(self) -> None:
        self._arming.settle("the heater was switched off in the meantime")
        self._state.report("OFF")
        if self._state.live is None:
            self._idle.make_safe()
        else:
            self._state.stop_requested = True

    def _stop_without_front(self) -> None:
        """Refuse a waiting request to arm, and stop the loop: nothing may heat while OFF on the page has no effect."""
        error = front_silent()
        self._arming.settle(str(error))
        if self._state.live is not None and not self._state.stop_requested:
            self._state.status.fail(self._state.now_s, error)
            self._state.stop_requested = True
