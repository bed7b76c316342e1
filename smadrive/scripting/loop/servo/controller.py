"""A servo in the loop process: it holds the wire, and moves it as the script commands while the loop runs.

Every motion is a new reference with a controller of its own. This controller takes over the state of the previous one,
so the current does not jump. Commands are read before each tick. In real time the loop never waits for the script. In
virtual time the loop waits for the next command when no motion is left: otherwise hours of virtual time would pass
until the script sends it.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from itertools import islice
from math import inf
from typing import Protocol

from smadrive.control.controllers.interface import Command
from smadrive.control.controllers.swappable import SwappableController
from smadrive.control.controllers.tracking import TrackingController
from smadrive.control.feedforward.displacement import HysteresisInverse
from smadrive.control.loop import Tick, TickHandler
from smadrive.control.references.holding import (
    APPROACH_S,
    holding_reference,
    moving_reference,
    resting_caveats,
)
from smadrive.control.references.reference import Reference
from smadrive.measurement import Measurement
from smadrive.rig.controllers import tracking_controller
from smadrive.rig.rig import Rig
from smadrive.runs.experiments import Watch
from smadrive.runs.run_log import TickRecorder
from smadrive.safety.arming_checks import check_thermocouple
from smadrive.scripting.loop.servo.messages import (
    FollowCommand,
    MotionCommand,
    MotionEnd,
    MoveCommand,
    SampleCommand,
    ServoCommand,
    ServoReport,
    ServoTick,
    StopCommand,
)
from smadrive.scripting.loop.servo.motions import FollowMotion, MoveMotion, superseded
from smadrive.wire.identified_wire import IdentifiedWire

MOST_TICKS = 4096
"""Number of ticks that may wait for the script. Older ones are dropped; the log has all of them."""

COMMANDS_AT_ONCE = 256
"""Number of commands that are taken between two ticks. The others wait for the next tick."""

TICKS_AT_ONCE = 32
"""Number of ticks in a report. A report is then smaller than the free space of a socket that accepts data."""


class ServoLink(Protocol):
    """The part of the link to the script that a servo uses."""

    def next_command(self, servo_id: str, *, waits: bool) -> ServoCommand | None:
        """Return the next command for a servo. If there is none, wait for it (`waits`) or return None."""
        ...

    def report(self, report: ServoReport, *, waits: bool) -> bool:
        """Send a report, and return True. If the script does not read, wait (`waits`) or return False."""
        ...


class ServoController:
    """The controller of a servo: it holds the wire, and moves it as the commands of `link` say.

    If `wire` has no heat balance, the controller uses the nominal heat balance of the rig. The constructor measures
    once, and heats nothing. ConfigError if the rig cannot use its source of the displacement.
    """

    duration_s = inf

    def __init__(self, rig: Rig, wire: IdentifiedWire, servo_id: str, link: ServoLink, *, is_virtual: bool) -> None:
        self._rig = rig
        in_file = wire.wire_model(rig.nominal_balance)
        self._wire = rig.usable(in_file)
        self._servo_id = servo_id
        self._link = link
        self._is_virtual = is_virtual
        self._motion: MoveMotion | FollowMotion | None = None
        self._samples: list[int] = []
        self._ticks: deque[ServoTick] = deque()
        self._ended: list[MotionEnd] = []
        self._dropped = 0
        self._event: Callable[[str], None] = lambda _text: None
        measurement = rig.measure()
        check_thermocouple(measurement)
        source = rig.config.displacement_from
        sensing = rig.check_sensing(in_file, source, measurement.temperature_c)
        self._warnings = *sensing, *resting_caveats(wire.model, measurement, source)
        reference = holding_reference(wire.model, measurement, source)
        self._swappable = SwappableController(self._controller(reference), reference, lambda: None)

    def trusts_sensor(self) -> bool:
        """Return False while the displacement sensor gives wrong readings."""
        return self._swappable.trusts_sensor()

    def update(self, time_s: float, measurement: Measurement, dt_s: float) -> Command:
        """Return the command for the coming period."""
        return self._swappable.update(time_s, measurement, dt_s)

    def watched(self, watch: Watch) -> Watch:
        """Return a Watch that calls `watch`, and passes each tick to the servo."""

        @contextmanager
        def both(recorder: TickRecorder, duration_s: float) -> Iterator[TickHandler]:
            self._event = recorder.event
            for warning in self._warnings:
                self._event(f"warning: {warning}")
            inner: AbstractContextManager[TickHandler] = watch(recorder, duration_s)
            with inner as record:

                def take(tick: Tick) -> None:
                    record(tick)
                    self._take(tick)
                    self._send()

                yield take

        return both

    def stop_requested(self) -> bool:
        """Send reports and carry out commands. Return True after a StopCommand.

        At most `COMMANDS_AT_ONCE` commands are taken, and of several motions only the latest begins: a script that
        commands faster than the loop ticks delays no tick.
        """
        self._send()
        latest: MotionCommand | None = None
        for _ in range(COMMANDS_AT_ONCE):
            match self._link.next_command(self._servo_id, waits=self._waits and latest is None):
                case None:
                    break
                case StopCommand():
                    return True
                case SampleCommand(number=number):
                    self._samples.append(number)
                case command:
                    if latest is not None:
                        self._ended += superseded(latest)
                    latest = command
        if latest is not None:
            self._begin(latest)
        return False

    @property
    def _waits(self) -> bool:
        return self._is_virtual and self._motion is None and not self._samples

    def _begin(self, command: MotionCommand) -> None:
        if self._motion is not None:
            self._ended += self._motion.superseded()
        reference = self._move(command) if isinstance(command, MoveCommand) else self._follow(command)
        self._swappable.swap(self._controller(reference), reference)

    def _move(self, command: MoveCommand) -> Reference:
        reference = moving_reference(self._swappable.setpoint_mm, command.setpoint_mm, command.speed_mm_per_s)
        self._motion = MoveMotion(command, reference.scored_from_s)
        self._event(f"move to {command.setpoint_mm:g} mm with at most {command.speed_mm_per_s:g} mm/s")
        return reference

    def _follow(self, command: FollowCommand) -> Reference:
        reference = command.reference.with_approach(self._swappable.setpoint_mm, APPROACH_S)
        self._motion = FollowMotion(command._replace(reference=reference))
        self._event(f"follow a reference of {command.reference.duration_s:g} s, after {APPROACH_S:g} s of approach")
        return reference

    def _controller(self, reference: Reference) -> TrackingController:
        return tracking_controller(self._rig.config, reference, self._wire, HysteresisInverse(self._wire.model))

    def _take(self, tick: Tick) -> None:
        """Note the motions that end with this tick. A tick that tripped ends none: the error of the run does."""
        if len(self._ticks) == MOST_TICKS:
            self._ticks.popleft()
            self._dropped += 1
        self._ticks.append(ServoTick(tick, self._followed()))
        self._ended += [MotionEnd(number, None) for number in self._samples]
        self._samples = []
        if self._motion is None or tick.tripped:
            return
        self._ended += self._motion.update(tick, self._swappable.reference_s)
        if self._motion.is_over:
            self._motion = None

    def _followed(self) -> int | None:
        """Return the number of the FollowCommand whose reference the present tick tracks, or None."""
        motion = self._motion
        return motion.followed(self._swappable.reference_s) if isinstance(motion, FollowMotion) else None

    def _send(self) -> None:
        """Send the waiting ticks and the ends of motions. The ends go with the last of these ticks."""
        while self._ticks or self._ended:
            ticks = tuple(islice(self._ticks, TICKS_AT_ONCE))
            is_last = len(ticks) == len(self._ticks)
            ended = tuple(self._ended) if is_last else ()
            if not self._link.report(ServoReport(ticks, ended, self._dropped), waits=self._is_virtual):
                return
            for _ in ticks:
                self._ticks.popleft()
            if is_last:
                self._ended = []
