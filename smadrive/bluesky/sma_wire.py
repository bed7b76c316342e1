"""A wire as a positioner, detector and flyer of bluesky.

The device follows the protocols of bluesky by its methods alone. A servo (scripting/servo.py) begins with the first
`set` or `kickoff`, and drives the wire until `stop`, `pause` or `unstage`. These three end at zero current, confirmed
by read-back. After an abort, a run engine stops the devices that it has set, but it does not stop a flyer. It unstages
every staged device, also a flyer. So `kickoff` needs a staged wire: the abort then switches the heater off.
"""

from __future__ import annotations

import inspect
import time
from collections.abc import Coroutine, Iterator, Mapping
from typing import Any

from smadrive.bluesky.flight import Flight
from smadrive.bluesky.paused_engine import ResumeCall
from smadrive.bluesky.pending_motions import PendingMotions
from smadrive.bluesky.readings import Readings, WireSample
from smadrive.bluesky.return_move import ReturnMove
from smadrive.bluesky.servo_end import end_servo
from smadrive.bluesky.setpoint import Setpoint
from smadrive.bluesky.settings import SmaWireSettings
from smadrive.control.controllers.interface import Command
from smadrive.control.loop import Tick
from smadrive.control.references.reference import Reference
from smadrive.errors import ConfigError, MotionError
from smadrive.scripting.arguments import (
    ReferenceLike,
    WireLike,
    check_displacement_within,
    check_reference_within,
    permitted_mm,
    reference_of_argument,
    travel_limits_mm,
    wire_of_argument,
)
from smadrive.scripting.motion import Motion
from smadrive.scripting.open_rig import OpenRig
from smadrive.scripting.servo import Servo


class SmaWire:
    """The identified `wire` on an open rig.

        with smadrive.open_rig("in-process") as rig:
            wire = SmaWire(rig, smadrive.load_wire("wire.json"), name="wire")
            RE(bp.scan([], wire, 2, 8, 5))

    `settings` are the options of a move, see `Servo.move`: `speed_mm_per_s`, `tolerance_mm`, `settle_s`, `timeout_s`.
    `configure` changes them. `log_file` is the log of the latest servo.
    """

    parent = None

    def __init__(self, rig: OpenRig, wire: WireLike, *, name: str = "wire", **settings: float) -> None:
        self.name = name
        self._rig = rig
        self._wire = wire_of_argument(wire)
        self._settings = SmaWireSettings.for_limits(travel_limits_mm(self._wire)).changed(**settings)
        self._readings = Readings(name, f"smadrive:{rig.config.name}", rig.quantities)
        self._servo: Servo | None = None
        self._is_staged = False
        self._setpoint = Setpoint()
        self._idle: WireSample | None = None
        self._reference: Reference | None = None
        self._flight: Flight | None = None
        self._pending = PendingMotions()
        self._return = ReturnMove(name, self._setpoint)

    @property
    def hints(self) -> dict[str, Any]:
        """The reading that tables and plots show."""
        return {"fields": [self._readings.main]}

    @property
    def limits(self) -> tuple[float, float]:
        """The smallest and the greatest displacement that the wire can reach and the rig permits, in mm."""
        return permitted_mm(self._wire, self._rig.config.limits)

    @property
    def log_file(self) -> str:
        """The absolute path of the log of the latest servo; empty before the first one."""
        return "" if self._servo is None else str(self._servo.log_file.absolute())

    def check_value(self, value: float) -> None:
        """Raise ConfigError for a displacement in mm outside `limits`."""
        check_displacement_within(value, self.limits)

    def set(self, value: float) -> Motion:
        """Move to a displacement in mm. The status is done when the wire has settled, and fails after a trip."""
        self.check_value(value)
        motion = self._running_servo().move(value, **self._settings.options._asdict())
        self._setpoint.set(float(value))
        return self._pending.add(motion)

    def locate(self) -> dict[str, float]:
        """Return `setpoint` and `readback`, the displacement, in mm. Without a setpoint, both are the displacement."""
        readback_mm = self._readings.values(self._sample())[self._readings.main]
        return {"setpoint": self._setpoint.value_or(readback_mm), "readback": readback_mm}

    def trigger(self) -> Motion:
        """Take a fresh measurement: the next tick of the servo or, if no servo runs, a measurement at zero current."""
        if self._servo is not None and self._servo.is_running:
            return self._pending.add(self._servo.sample())
        self._idle = self._measured()
        motion = Motion("measurement")
        motion.finish()
        return motion

    def read(self) -> dict[str, dict[str, Any]]:
        """Return the latest measurement. Times are those of the measurement; a fault is an alarm."""
        return self._readings.read(self._sample())

    def describe(self) -> dict[str, dict[str, Any]]:
        """Return the data keys of `read`, with units."""
        return self._readings.describe()

    def read_configuration(self) -> dict[str, dict[str, Any]]:
        """Return the settings, the rig, the model's source and the log."""
        texts = {"rig": self._rig.config.name, "model_source": self._wire.source, "log_file": self.log_file}
        return self._settings.read(self.name, texts)

    def describe_configuration(self) -> dict[str, dict[str, Any]]:
        """Return the data keys of `read_configuration`."""
        return self._settings.describe(self.name, ("rig", "model_source", "log_file"))

    def configure(
        self, values: Mapping[str, float] | None = None, /, **settings: float
    ) -> tuple[dict[str, Any], dict[str, Any]]:
        """Change settings, named or in a mapping; return the old and the new configuration. May raise ConfigError."""
        before = self.read_configuration()
        self._settings = self._settings.changed(**{**(values or {}), **settings})
        return before, self.read_configuration()

    def stage(self) -> list[SmaWire]:
        """Take one measurement. Nothing is heated."""
        self.trigger()
        self._is_staged = True
        return [self]

    def unstage(self) -> list[SmaWire]:
        """Switch the heater off, confirmed by read-back."""
        self._is_staged = False
        self.stop()
        return [self]

    def stop(self, success: bool = True) -> None:
        """Switch the heater off, confirmed by read-back. If `success` is False, the motions under way fail.

        Otherwise they end with success, but a flight before the end of its reference fails. An error is raised only if
        the heater is not confirmed off. A trip raises no error here, because the status of the interrupted motion has
        failed already. In a callback of a status this method only requests the end: a callback must not wait for the
        read-back.
        """
        self._setpoint.stop()
        self._end(None if success else MotionError("was stopped", where=self.name))

    def pause(self) -> None:
        """Switch the heater off, and keep the setpoint for `resume`. A flight fails, and does not go on."""
        self._setpoint.pause(is_held=self._servo is not None and self._servo.is_running)
        self._end(None)

    def resume(self) -> Coroutine[Any, Any, None]:
        """Return a coroutine that moves to the setpoint that the pause has ended, until the wire has settled there.

        A run engine repeats only what the plan has done since its last checkpoint, and this need not contain the `set`.
        See `ReturnMove.run` for errors. If `RE.resume()`, which calls this method, fails or is interrupted before the
        engine goes on, the heater is switched off. Only the engine itself may call this method while it is paused.
        """
        return self._return.run(ResumeCall(inspect.currentframe()), self.set, self._end)

    def prepare(self, value: ReferenceLike) -> Motion:
        """Choose the reference that `kickoff` tracks. ConfigError if it leaves the travel or the limits of the rig."""
        reference = reference_of_argument(value)
        check_reference_within(reference, self._wire, self._rig.config.limits)
        self._reference = reference
        motion = Motion("preparation")
        motion.finish()
        return motion

    def kickoff(self) -> Motion:
        """Move to the beginning of the prepared reference. The status is done when its tracking begins.

        ConfigError without a reference, and unless the wire is staged.
        """
        if self._reference is None:
            raise ConfigError("no reference is prepared", where=self.name, cure="call prepare(reference) before")
        if not self._is_staged:
            cure = "use bluesky.preprocessors.stage_wrapper: it switches the heater off after an abort"
            raise ConfigError("a flyer must be staged", where=self.name, cure=cure)
        self._flight = Flight(self._running_servo(), self._reference)
        self._setpoint.release()
        cure = "begin a new flight with kickoff"
        cut = MotionError("the flight was ended before the end of its reference", where=self.name, cure=cure)
        self._pending.add(self._flight.flown, cut)
        return self._pending.add(self._flight.approach)

    def complete(self) -> Motion:
        """Return the status of the flight, which is done at the end of the reference. ConfigError before `kickoff`.

        The status has failed with MotionError after `stop`, `pause` or `unstage` before the end of the reference.
        """
        if self._flight is None:
            raise ConfigError("nothing flies", where=self.name, cure="call kickoff before")
        return self._flight.flown

    def describe_collect(self) -> dict[str, dict[str, dict[str, Any]]]:
        """Return the data keys of the flight's stream, NAME_fly."""
        return {f"{self.name}_fly": self.describe()}

    def collect(self) -> Iterator[dict[str, Any]]:
        """Yield an event for each tick of the reference since the last `collect`."""
        if self._flight is not None:
            yield from map(self._readings.event, self._flight.samples())

    def _end(self, error: MotionError | None) -> None:
        """End the motions under way, with this error or with success, and switch the heater off. A flight fails."""
        ended = self._pending.decide(error)
        if self._servo is not None:
            self._servo.request_end()
        for motion in ended:
            motion.call_back()
        if self._servo is not None:
            end_servo(self._servo, self._rig)

    def _running_servo(self) -> Servo:
        if self._servo is None or not self._servo.is_running:
            self._servo, self._idle = self._rig.servo(self._wire), None
        return self._servo

    def _sample(self) -> WireSample:
        """Return the latest tick of the servo, after its first one, or else the latest measurement at zero current."""
        servo = self._servo
        if servo is not None and servo.is_running:
            if servo.tick is None:
                servo.sample().wait()
            assert servo.tick is not None
            return WireSample(servo.tick, servo.unix_s(servo.tick))
        if self._idle is None:
            self._idle = self._measured()
        return self._idle

    def _measured(self) -> WireSample:
        tick = Tick(0.0, 0.0, self._rig.measure(), Command(0.0))
        return WireSample(tick, time.time(), is_driven=False, latched=self._rig.latched_trip())

    def __repr__(self) -> str:
        return f"SmaWire({self.name}, {self._rig.config.name})"
