"""A rig that a script has opened. Its loop runs in a separate process (loop_process.py)."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from smadrive.measurement import Measurement
from smadrive.rig.config import RigConfig
from smadrive.runs.health.recording import health_recorded
from smadrive.runs.log.reader import read_log
from smadrive.runs.tracking_plan import check_reach
from smadrive.scripting.arguments import (
    PathText,
    ReferenceLike,
    ScriptController,
    WireLike,
    cooling_time_s,
    cycling_of_argument,
    reference_of_argument,
    rig_of,
    source_of_argument,
    step_of_arguments,
    wire_of_argument,
)
from smadrive.scripting.log_names import new_log
from smadrive.scripting.loop.messages import (
    ClearFaultsRequest,
    CoolDownRequest,
    DrivenRun,
    DriveRequest,
    ExciteRequest,
    HeatRequest,
    LatchRequest,
    MeasureRequest,
    SwitchOffRequest,
    TrackRequest,
)
from smadrive.scripting.loop.own_controller import check_controller
from smadrive.scripting.progress import shown_progress
from smadrive.scripting.rig_connection import RigConnection, switch_off_after
from smadrive.scripting.run import Run
from smadrive.scripting.servo import Servo


class OpenRig(RigConnection):
    """The connected devices of a rig. The end of this context manager switches the heater off, confirmed by read-back.

        with smadrive.open_rig("in-process") as rig:
            run = rig.excite()

    In a notebook the rig may stay open from cell to cell; call `close()` at the end. Loop, supervisor and log run in a
    separate process, so a busy script delays no tick. Ctrl-C, the interruption of a kernel and every end of the script
    end a run at zero current. The methods raise the errors of the loop process.
    """

    def measure(self) -> Measurement:
        """Return one measurement at zero current."""
        measurement: Measurement = self._call(MeasureRequest())
        return measurement

    def excite(self, log: PathText | None = None) -> Run:
        """Run the identification experiment of the rig file and record the run. The wire is heated.

            run = rig.excite("excitation.h5")

        Without `log` the file is excitation.h5 or, if it exists, excitation-2.h5 and so on. TripError after a trip.
        """
        path = new_log(self, log, "excitation")
        return self._run("exciting", ExciteRequest(path.absolute()), path)

    def heat(
        self,
        duration_s: float,
        *,
        current_a: float | None = None,
        temperature_c: float | None = None,
        log: PathText | None = None,
    ) -> Run:
        """Hold a current or a temperature for `duration_s`, and record the run.

            warm = rig.heat(30, temperature_c=60)

        Without `log` the file is heat.h5 or, if it exists, heat-2.h5 and so on. ConfigError for a value beyond a limit
        of the rig. TripError after a trip.
        """
        step, path = step_of_arguments(duration_s, current_a, temperature_c), new_log(self, log, "heat")
        return self._run(f"heating, {step}", HeatRequest(path.absolute(), step), path)

    def track(
        self,
        reference: ReferenceLike,
        wire: WireLike,
        log: PathText | None = None,
        *,
        smooth: bool = False,
        repeat: int | None = None,
        displacement_from: str | None = None,
    ) -> Run:
        """Track a displacement reference by the inverse of the identified wire.

            run = rig.track(smadrive.sine(low_mm=2, high_mm=9, period_s=56), wire, "run.h5")

        The run is simulated on the model before the wire is heated. ConfigError when the wire cannot follow the
        reference; with `smooth` the run tracks the nearest reference that the wire can follow. With `repeat`, the
        reference is repeated, and `run.cycles` are the metrics of each cycle. `displacement_from` is "sensor",
        "resistance" or "none"; by default the rig file decides. TripError after a trip.
        """
        path, identified, given = new_log(self, log, "run"), wire_of_argument(wire), reference_of_argument(reference)
        check_reach(given, identified)
        cycling, chosen = cycling_of_argument(given, repeat), source_of_argument(displacement_from)
        request = TrackRequest(path.absolute(), given, identified, bool(smooth), cycling, chosen)
        return self._run("tracking", request, path)

    def drive(
        self,
        controller: ScriptController,
        wire: WireLike,
        log: PathText | None = None,
        *,
        duration_s: float | None = None,
    ) -> Run:
        """Run your own controller on the wire for `duration_s`, with the full supervision of every run.

            class Warm:
                def update(self, time_s, measurement, dt_s):
                    return smadrive.Command(0.2 if measurement.temperature_c < 60 else 0.1)

            run = rig.drive(Warm(), wire, duration_s=20)

        `update` is called once per tick, in the loop process, on a copy of the controller. After the run,
        `run.controller` is this copy. The current is clamped to the range from 0 to current_max_a. If the commands have
        a `setpoint_mm`, the metrics of the run include tracking errors. Without `duration_s` the controller must have
        an attribute `duration_s`. An error that `update` raises ends the run at zero current, and is raised by `drive`.
        ControllerError if `update` returns no command or a current far beyond current_max_a, or takes too long.
        """
        check_controller(controller, duration_s)
        path = new_log(self, log, "run")
        length_s = None if duration_s is None else float(duration_s)
        request = DriveRequest(path.absolute(), controller, length_s, wire_of_argument(wire))
        return self._run("driving", request, path)

    def cool_down(self, duration_s: float) -> None:
        """Let the wire cool for `duration_s` with the heater off. ConfigError unless this is 0 s to a day."""
        self._call(CoolDownRequest(cooling_time_s(duration_s)))

    def off(self) -> None:
        """Switch the heater off and confirm it by read-back; raises an error if the heater is not confirmed off.

        A servo stops; if its run has an error, this is raised once the heater is off. A run that another thread has
        started ends: that thread gets a SafetyError. In a callback of the servo, MotionError: the servo stops, and its
        run switches off.
        """
        self._check_open()
        self._check_may_switch_off()
        self._end_all(self._switch_off)

    def _switch_off(self) -> bool:
        self._client.call(SwitchOffRequest())
        return True

    def latched_trip(self) -> str | None:
        """Return the trip that keeps the rig from heating, with its cause and remedy; None without one."""
        latched: str | None = self._call(LatchRequest())
        return latched

    def clear_faults(self) -> Measurement:
        """Clear the latched faults and the trip latch, and return a measurement. SafetyError if a fault persists."""
        measurement: Measurement = self._call(ClearFaultsRequest())
        return measurement

    def _run(self, title: str, request: Any, path: Path) -> Run:
        self._check_free()
        warnings: list[str] = []
        try:
            with health_recorded(path, warnings.extend), shown_progress(f"{title}, {path.name}") as show:
                driven: DrivenRun = self._client.call(request, show)
        except BaseException as error:
            if os.path.lexists(path):
                error.add_note(f"the record of the run up to its end: {path}")
            raise
        return Run(read_log(path), driven, warnings)

    def servo(self, wire: WireLike, log: PathText | None = None) -> Servo:
        """Hold the wire, and return the servo that moves it to setpoints while the loop runs. The wire is heated.

            with rig.servo(wire) as servo:
                servo.move(4.0).wait()

        Until the servo is stopped, every other method that uses the devices, also `measure`, raises ConfigError; `off`
        and `close` stop the servo. In virtual time the clock stops when no motion is left, and goes on with
        the next command.
        """
        self._check_open()
        with self._one_servo:
            self._check_free()
            servo = Servo(self._client, wire_of_argument(wire), self.config.limits, new_log(self, log, "servo"))
            self._servo = servo
            try:
                servo.begin()
            except BaseException as interruption:  # the script gets no servo that it could stop
                switch_off_after(interruption, self._stop_servo)
                raise
        return servo


def open_rig(rig: RigConfig | PathText) -> OpenRig:
    """Open a rig: a shipped name, the path of a rig file, or a RigConfig. Nothing is heated.

        with smadrive.open_rig("in-process") as rig:
            print(rig.measure())

    ConfigError for a rig file that cannot be used, TransportError when a port does not open, DeviceError when another
    device answers.
    """
    return OpenRig(rig_of(rig))
