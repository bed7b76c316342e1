"""A servo: the wire is held, and moves to setpoints that the script gives while the loop runs."""

from __future__ import annotations

import secrets
import threading
import time
from collections.abc import Callable
from functools import cached_property
from pathlib import Path
from types import TracebackType
from typing import Self

from smadrive.control.loop import Tick, TickHandler
from smadrive.control.references.limits import check_end
from smadrive.control.references.reference import Reference
from smadrive.errors import MotionError
from smadrive.interrupts import signals_obeyed_afterwards
from smadrive.measurement import Measurement
from smadrive.numerics.scalars import real_number
from smadrive.rig.config import LimitsConfig
from smadrive.runs.health.recording import record_health
from smadrive.runs.log.reader import read_log
from smadrive.scripting.arguments import (
    check_displacement_within,
    check_reference_within,
    permitted_mm,
    travel_limits_mm,
)
from smadrive.scripting.callbacks import is_callback, succeeds
from smadrive.scripting.loop.client.loop_client import LOOK_S, LoopClient
from smadrive.scripting.loop.messages import DrivenRun, ServoRequest
from smadrive.scripting.loop.servo.messages import (
    FollowCommand,
    MoveCommand,
    SampleCommand,
    ServoCommand,
    ServoReport,
    StopCommand,
)
from smadrive.scripting.motion import Motion, RunMotions, run_ended
from smadrive.scripting.move_options import SETTLE_S, TIMEOUT_S, move_options
from smadrive.scripting.run import Run
from smadrive.wire.identified_wire import IdentifiedWire

STOPS_WITHIN_S = 30.0
"""The loop process is killed if it has not ended the run after this time in s. The tries to switch off a silent device
take some 10 s, and the guardian needs up to 5 s more."""


class Servo:
    """Holds the wire from now on, and moves it. A context manager that ends at zero current, confirmed by read-back.

        with rig.servo(wire) as servo:
            servo.move(4.0).wait()
            print(servo.measurement)

    The run is supervised and recorded in a log like every run. After a trip, all motions fail with the TripError.

    takers     functions that are called with each tick, in another thread, where they must not wait; one that raises
               an error is called no more
    dropped    number of ticks that this process did not get, because it did not read in time; the log has them
    limits     smallest and greatest displacement that the wire can reach and the rig permits, mm
    """

    def __init__(self, client: LoopClient, wire: IdentifiedWire, rig_limits: LimitsConfig, log_file: Path) -> None:
        self.log_file = log_file
        self.takers: list[TickHandler] = []
        self.dropped = 0
        self.limits = permitted_mm(wire, rig_limits)
        self._client, self._wire, self._rig_limits = client, wire, rig_limits
        self._id = secrets.token_hex(8)
        self._motions, self._followers = RunMotions(), dict[int, TickHandler]()
        self._latest: Tick | None = None
        self._driven: DrivenRun | None = None
        self._warnings: tuple[str, ...] = ()
        self._error: BaseException | None = None
        self._is_replied, self._began_s = threading.Event(), 0.0
        client.on_report = self._receive
        self._request = ServoRequest(self._id, log_file.absolute(), wire)
        self._thread = threading.Thread(target=self._run, name="servo", daemon=True)

    def begin(self) -> None:
        """Begin the run. Call this once, when the rig already has this servo, so that its `close` stops it."""
        with signals_obeyed_afterwards():
            self._thread.start()

    def __enter__(self) -> Self:
        """Return this servo."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End the run at zero current. Raise its error, unless the block has. No effect in a forked child."""
        if not self._client.owner.is_present:
            return
        self.end()
        if self._error is not None and self._error is not error:
            self._client.child.note_raised(self._error)
            raise self._error

    @property
    def is_running(self) -> bool:
        """True until the run has ended."""
        return self._thread.is_alive()

    @property
    def error(self) -> BaseException | None:
        """The error that has ended the run, or None."""
        return self._error

    @property
    def tick(self) -> Tick | None:
        """The latest tick; None before the first one."""
        return self._latest

    @property
    def measurement(self) -> Measurement:
        """The latest measurement; waits for the first one. Raises the error of the run, or MotionError, after its end.

        So a script that waits for a value does not wait for ever. `tick` still returns the last tick.
        """
        self._client.owner.check()
        if self._motions.are_over:
            raise self._error or run_ended()
        if self._latest is None:
            self.sample().wait()
        assert self._latest is not None
        return self._latest.measurement

    def unix_s(self, tick: Tick) -> float:
        """Return the time of a tick since 1970-01-01 UTC, in s, by the present setting of the machine's clock."""
        return time.time() - time.monotonic() + self._began_s + tick.time_s

    def move(
        self,
        displacement_mm: float,
        *,
        speed_mm_per_s: float | None = None,
        tolerance_mm: float | None = None,
        settle_s: float = SETTLE_S,
        timeout_s: float = TIMEOUT_S,
    ) -> Motion:
        """Move the wire smoothly to a displacement, and hold it there.

        speed_mm_per_s   greatest speed of the path; by default a move through the whole travel takes 10 s
        tolerance_mm     greatest distance from the setpoint; by default 1 % of the travel
        settle_s         when the path has ended and the wire has been within the tolerance for this time, the motion is
                         done
        timeout_s        the motion fails if it is not done at this time after the end of the path

        ConfigError for a displacement outside `limits`, for a number that is not positive (`settle_s` may be 0), and
        for a speed at which a move through the whole travel takes longer than a day.
        """
        options = move_options(travel_limits_mm(self._wire), speed_mm_per_s, tolerance_mm, settle_s, timeout_s)
        setpoint_mm = real_number(displacement_mm, "displacement_mm")
        check_displacement_within(setpoint_mm, self.limits)
        return self._command(f"move to {setpoint_mm:g} mm", lambda number: MoveCommand(number, setpoint_mm, *options))

    def follow(self, reference: Reference, take: TickHandler | None = None) -> tuple[Motion, Motion]:
        """Move to the beginning of a reference, then track it.

        Return two motions: the first is done when the tracking begins, the second at the end of the reference. `take`
        is called like one of the `takers`, but only with the ticks of the reference, before the second motion ends.
        ConfigError for a reference that leaves the travel or exceeds a displacement limit of the rig, or has no end.
        """
        check_reference_within(reference, self._wire, self._rig_limits)
        check_end(reference.duration_s)
        self._client.owner.check()
        begun_number, approach = self._motions.begin("approach to the reference")
        return approach, self._command("reference", lambda number: FollowCommand(number, begun_number, reference), take)

    def sample(self) -> Motion:
        """Return a motion that ends with the next tick: `tick` is then fresh."""
        return self._command("next sample", SampleCommand)

    def stop(self) -> None:
        """End the run at zero current, confirmed by read-back. Raises the error that has ended the run.

        In a taker or a callback of a motion, request this end and return: these functions must not wait.
        """
        self._client.owner.check()
        self.__exit__(None, None, None)

    def request_end(self) -> None:
        """Request the end of the run at zero current, and return at once. `stop` waits for it."""
        self._client.command(self._id, StopCommand())

    @cached_property
    def run(self) -> Run:
        """The recorded run, after the servo has ended. MotionError while the servo runs."""
        self._client.owner.check()
        if self.is_running:
            raise MotionError("still runs", where="servo", cure="stop it first")
        return Run(read_log(self.log_file), self._driven, self._warnings)

    def __repr__(self) -> str:
        return f"Servo({self.log_file}, {'running' if self.is_running else 'ended'})"

    def _command(
        self, what: str, command_of: Callable[[int], ServoCommand], follower: TickHandler | None = None
    ) -> Motion:
        self._client.owner.check()
        number, motion = self._motions.begin(what)
        if follower is not None:
            self._followers[number] = follower
        self._client.command(self._id, command_of(number))
        return motion

    def end(self) -> None:
        """End the run as `stop` does, but raise no error of the run: `error` is this error."""
        with signals_obeyed_afterwards():
            self.request_end()
        if is_callback():
            return
        turn_s = 0.0  # the servo may still wait for a run of another thread
        while not self._is_replied.wait(LOOK_S):
            turn_s += LOOK_S * self._client.carries_out(self._request)
            if turn_s > STOPS_WITHIN_S:
                self._client.kill()
        self._thread.join()

    def _run(self) -> None:
        """Wait for the end of the run, add the run to the health record, and end all motions that are left."""
        try:
            self._driven = self._client.call(self._request)
        except BaseException as error:  # noqa: BLE001 (raised by `stop`, and by each motion)
            self._error = error
        self._is_replied.set()
        try:
            self._warnings = record_health(self.log_file)
        finally:
            self._motions.end(self._error or run_ended())

    def _receive(self, report: ServoReport) -> None:
        """Take a report, in the thread of the link."""
        self.dropped = report.dropped
        if self._latest is None and report.ticks:
            self._began_s = time.monotonic() - report.ticks[-1].tick.time_s
        for tick, followed in report.ticks:
            self._latest = tick
            for take in tuple(self.takers):
                if not succeeds(take, tick) and take in self.takers:
                    self.takers.remove(take)
            if followed in self._followers and not succeeds(self._followers[followed], tick):
                del self._followers[followed]
        for number, error in report.ended:
            self._followers.pop(number, None)
            self._motions.finish(number, error)
