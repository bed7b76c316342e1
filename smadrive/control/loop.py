"""The control loop. Each tick measures, supervises, controls and commands. The ticks have absolute deadlines.

One exchange per tick writes the command of the previous tick and reads the wire. So a command acts one period after
its measurement, and the controllers take this delay into account. A lost exchange does not end the run: the supervisor
trips when no measurement arrives for too long. `run` always puts the heater into its safe state before it ends: at the
end of the run, after a trip, an exception or Ctrl-C. The loop checks for a request to stop (OFF) before every tick.
After such a request the loop commands no more current, even if the device does not answer.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import isfinite, nan
from typing import NamedTuple, Protocol

from smadrive.clock import Clock
from smadrive.control.controllers.interface import Command, Controller
from smadrive.errors import DeviceError, ExceptionReply, ProtocolError, TakenOverError, TransportError, TripError
from smadrive.measurement import Measurement
from smadrive.safety.faults import Fault, Trip
from smadrive.safety.shutdown import NOT_TRIED, carry, ends_safe, shut_down
from smadrive.safety.supervisor import Supervisor

LATE_FRACTION = 0.5
"""A tick has missed its deadline if it starts more than this share of the period after the deadline."""

SHORTEST_S = 1e-9
"""A tick so soon after the last one measures nothing new. It occurs with a virtual clock only, after a late tick."""

StopRequested = Callable[[], bool]
"""Returns True if the user has requested a stop. The loop calls this function before every tick."""


def never() -> bool:
    """Return False: no user requests a stop. The run ends after the duration of its controller, a trip or an error."""
    return False


class Actuator(Protocol):
    """The interface of a heater for the loop."""

    def arm(self, watchdog_s: float) -> None:
        """Enable heating at zero current; the device switches off after `watchdog_s` without a command."""
        ...

    def exchange(self, current_a: float) -> Measurement:
        """Command `current_a` for the coming period, and return the measurement of the same exchange."""
        ...

    def end_heat(self) -> None:
        """Command zero current once; `enter_safe_state` follows."""
        ...

    def enter_safe_state(self) -> None:
        """Bring the current to zero, and confirm zero by read-back."""
        ...


class Tick(NamedTuple):
    """One tick of the loop.

    `time_s` is the time of the measurement since the start of the loop. The tick started `late_s` after its deadline.
    `command` is the command that the controller computed from `measurement`. `tripped` is True for the last tick of a
    run whose measurement tripped. No controller gets this measurement, so its command has no current, and the setpoints
    and estimates of the command before.
    """

    time_s: float
    late_s: float
    measurement: Measurement
    command: Command
    tripped: bool = False

    @property
    def measured_mm(self) -> float:
        """The measured displacement, mm; NaN if none is measured, or if the sensor is replaced."""
        return nan if self.command.sensor_replaced else self.measurement.displacement_mm

    @property
    def reached_mm(self) -> float:
        """The measured displacement, mm; the estimated one if none is measured, or if the sensor is replaced."""
        return self.measured_mm if isfinite(self.measured_mm) else self.command.estimated_mm


TickHandler = Callable[[Tick], None]
"""A function that is called with each tick of a run."""


@dataclass(slots=True)
class LoopMetrics:
    """Counts of one run of the loop."""

    ticks: int = 0
    missed_deadlines: int = 0
    lost_exchanges: int = 0
    trips: int = 0


class ControlLoop:
    """Runs one controller on one heater under one supervisor, with a tick every `period_s`.

    `record` is called with each tick; with the tick of a trip after the heater is off. After `stop_requested` has
    returned True, the loop sends only the safe state.
    `on_trip` is called with a trip after one command of zero current, and before the loop switches the heater off,
    because the process may be killed while it switches off.
    """

    def __init__(
        self,
        heater: Actuator,
        controller: Controller,
        supervisor: Supervisor,
        clock: Clock,
        period_s: float,
        record: TickHandler,
        stop_requested: StopRequested = never,
        on_trip: Callable[[TripError], None] = lambda _trip: None,
    ) -> None:
        self._heater = heater
        self._controller = controller
        self._supervisor = supervisor
        self._clock = clock
        self._period_s = period_s
        self._record = record
        self._stop_requested = stop_requested
        self._on_trip = on_trip
        self._command = Command(0.0)
        self._start_s = 0.0
        self._last_s = 0.0
        self._overran = False
        self._tripping: Tick | None = None
        self.metrics = LoopMetrics()

    def run(self, watchdog_s: float) -> LoopMetrics:
        """Arm the heater, run the ticks, bring the heater into its safe state, and return the counts of the run.

        The ticks end after the duration of the controller, or after a stop request. The device switches its heater off
        after `watchdog_s` without a command. SafetyError when heating must not begin. TripError when the supervisor
        trips, the device rejects a command, or the guardian has taken over the heater.
        """
        try:
            with ends_safe(self._heater.enter_safe_state, is_run=True):
                self._supervisor.check_may_arm(self._heater.exchange(0.0))
                self._heater.arm(watchdog_s)
                self._start_s = self._clock.now_s()
                self._last_s = -self._period_s
                self._tick_to_the_end()
        except TripError as trip:
            self._record_trip(trip)
            raise
        return self.metrics

    def _record_trip(self, trip: TripError) -> None:
        """Record the measurement that tripped, if there is one. A failure to record it becomes the cause of the trip.

        So a full disk or a signal does not hide the trip.
        """
        if self._tripping is None:
            return
        try:
            self._record(self._tripping)
        except BaseException as failure:  # noqa: BLE001 (the trip is raised)
            trip.__cause__ = failure

    def _tick_to_the_end(self) -> None:
        number = 0
        while number * self._period_s <= self._controller.duration_s:
            due_s = self._start_s + number * self._period_s
            self._clock.sleep_until(due_s)
            if self._stop_requested():
                return
            self.tick(late_s=self._clock.now_s() - due_s)
            number += 1 + self._skipped(due_s)

    def _skipped(self, due_s: float) -> int:
        """Return the number of deadlines that passed during the tick due at `due_s`. Their ticks are left out."""
        skipped = max(int((self._clock.now_s() - due_s) / self._period_s - LATE_FRACTION), 0)
        self.metrics.missed_deadlines += skipped
        self._overran = skipped > 0
        return skipped

    def tick(self, late_s: float) -> None:
        """Run one tick, which begins `late_s` after its deadline. TripError for the reasons of `run`.

        Controller and log use the time of the measurement as the time of the tick, not the deadline. A device that
        answers late has also changed its current late. With the deadline, this delay would look like a change of the
        heat input.
        """
        self.metrics.ticks += 1
        missed = late_s > LATE_FRACTION * self._period_s
        self.metrics.missed_deadlines += missed
        self._stop_if(self._supervisor.check_deadline(missed or self._overran, self._clock.now_s()))
        measurement = self._exchange()
        if measurement is None:
            self._stop_if(self._supervisor.check_fresh(self._clock.now_s()))
            return
        time_s = measurement.time_s - self._start_s
        if time_s - self._last_s < SHORTEST_S:
            return
        if (trip := self._supervisor.update(measurement, self._command.setpoint_mm)) is not None:
            self._tripping = Tick(time_s, late_s, measurement, self._command.after_trip(), tripped=True)
            raise self._tripped(trip)
        dt_s, self._last_s = time_s - self._last_s, time_s
        self._command = self._controller.update(time_s, measurement, dt_s)
        self._record(Tick(time_s, late_s, measurement, self._command))

    def _exchange(self) -> Measurement | None:
        """Return the measurement of one exchange; None when the exchange was lost or the device was busy.

        TripError when the device rejects the command, or when the guardian has taken over the heater.
        """
        try:
            return self._heater.exchange(self._command.commanded_a)
        except (TransportError, ProtocolError):
            self.metrics.lost_exchanges += 1
            return None
        except DeviceError as rejection:
            if isinstance(rejection, ExceptionReply) and rejection.is_transient:
                self.metrics.lost_exchanges += 1
                return None
            raise self._tripped(Trip(Fault.COMMAND_REFUSED, self._clock.now_s(), str(rejection))) from rejection
        except TakenOverError as taken:
            raise self._tripped(Trip(Fault.GUARDIAN, self._clock.now_s(), str(taken))) from taken

    def _stop_if(self, trip: Trip | None) -> None:
        if trip is not None:
            raise self._tripped(trip)

    def _tripped(self, trip: Trip) -> TripError:
        """Command zero current once, call `on_trip`, which may wait for a disk, and return the error of the trip.

        The command may fail: the safe state follows in any case. After a take-over the heater sends no command. A
        signal meanwhile does not replace the trip, but counts for the switching off.
        """
        self.metrics.trips += 1
        error = trip.error()

        def end_heat() -> None:
            try:
                self._heater.end_heat()
            finally:
                self._on_trip(error)

        outcome = shut_down(end_heat)
        carry(error, replace(NOT_TRIED, signals=outcome.signals))
        return error
