"""The loop process opens the rig, carries out the script's requests, and at the end switches the heater off.

When the script ends, even by a kill, this process ends the run at zero current, confirms this by read-back, and exits.
Signals of the terminal do not reach this process; the script sends interruptions to it (script_link.py).
"""

from __future__ import annotations

import pickle
import sys
from contextlib import nullcontext, suppress
from traceback import walk_tb
from typing import Any

from smadrive.clock import MonotonicClock, VirtualClock
from smadrive.control.loop import LoopMetrics
from smadrive.errors import ControllerError, SafetyError, StoppedError, TripError
from smadrive.real_time import use_real_time_scheduling
from smadrive.rig.plan import stale_after_s
from smadrive.rig.rig import Rig
from smadrive.runs.experiments import drive, excite, heat, plan_excitation, track
from smadrive.runs.run_kind import RunKind
from smadrive.runs.tracking_plan import plan_tracking
from smadrive.safety.shutdown import shutdown_of
from smadrive.scripting.loop.code_origin import dumps
from smadrive.scripting.loop.messages import (
    AnyScriptRequest,
    ClearFaultsRequest,
    CloseRequest,
    CoolDownRequest,
    DrivenRun,
    DriveRequest,
    ExciteRequest,
    HeatRequest,
    LatchRequest,
    MeasureRequest,
    OpenedRig,
    OpenRequest,
    ScriptEndedError,
    ServoRequest,
    SwitchOffRequest,
    TrackRequest,
)
from smadrive.scripting.loop.own_controller import OwnController, Pace
from smadrive.scripting.loop.script_link import ScriptLink
from smadrive.scripting.loop.servo.controller import ServoController


def serve(link: ScriptLink) -> None:
    """Open the rig of the first request, then carry out requests until a CloseRequest. Each request gets a reply.

    ScriptEndedError at the end of the script. If the heater is then not confirmed off, this is printed to standard
    error, because no reply can say it any more, and the exit code of the process is 4.
    """
    try:
        opening: OpenRequest = link.opening()
        sys.path[:] = opening.module_path
        with Rig(opening.config) as rig:
            link.stop_requested = lambda: rig.stop.requested
            identities = {name: str(one) for name, one in rig.identities.items()}
            quantities = tuple(quantity for quantity in ("temperature", "displacement") if rig.measures(quantity))
            link.reply(OpenedRig(identities, _is_virtual(rig), quantities))
            if isinstance(rig.clock, MonotonicClock):
                use_real_time_scheduling()
            while not _is_last(link, rig):
                pass
    except (Exception, StoppedError) as error:  # noqa: BLE001 (the script gets the error)
        link.finish()
        link.fail(error, is_own_code=False)
    except ScriptEndedError as ended:
        link.finish()
        outcome = shutdown_of(ended)
        if outcome is not None and not outcome.confirmed:
            with suppress(OSError):
                sys.stderr.write(f"smadrive: {outcome}\n")
            raise SystemExit(SafetyError.exit_code) from None
        raise
    else:
        link.finish()
        link.reply(None)


def _is_virtual(rig: Rig) -> bool:
    return isinstance(rig.clock, VirtualClock)


def _is_last(link: ScriptLink, rig: Rig) -> bool:
    """Carry out one request and reply. Return True for a CloseRequest; `serve` replies after it has closed the rig."""
    request: Any = None
    try:
        request = link.request()
        if isinstance(request, CloseRequest):
            return True
        with link.interruptible():
            value = carried_out(request, rig, link)
        link.reply(value)
    except (Exception, KeyboardInterrupt) as error:
        if rig.stop.requested:
            raise KeyboardInterrupt from error
        link.fail(error, is_own_code=request is None or _is_of_controller(error))
    return False


def _is_of_controller(error: BaseException) -> bool:
    """Return True if the user's code raised `error`; False for a ControllerError, which needs no traceback."""
    frames = (frame for frame, _ in walk_tb(error.__traceback__))
    is_below = any(frame.f_code is OwnController.update.__code__ for frame in frames)
    return is_below and not isinstance(error, ControllerError)


def carried_out(request: AnyScriptRequest, rig: Rig, link: ScriptLink) -> Any:
    """Carry out a request on the open rig, and return its result. Raises the error that ended the request."""
    match request:
        case MeasureRequest():
            return rig.measure()
        case ExciteRequest(log_file=log_file):
            return _counts(excite(log_file, rig, plan_excitation(rig), link.watch))
        case HeatRequest(log_file=log_file, step=step):
            return _counts(heat(log_file, rig, step, link.watch))
        case TrackRequest(log_file=log_file):
            with link.at_once():  # the simulation of a long reference takes minutes
                plan = plan_tracking(
                    rig,
                    request.reference,
                    request.wire,
                    smooth=request.smooth,
                    smooth_option="smooth=True",
                    cycling=request.cycling,
                    displacement_from=request.displacement_from,
                )
            return _counts(track(log_file, rig, plan, link.watch))
        case DriveRequest():
            return _driven(request, rig, link)
        case ServoRequest(servo_id=servo_id, log_file=log_file, wire=wire):
            servo = ServoController(rig, wire, servo_id, link, is_virtual=_is_virtual(rig))
            watch, kind = servo.watched(link.watch), RunKind.SERVO
            stop, trusts = servo.stop_requested, servo.trusts_sensor
            return _counts(drive(log_file, rig, servo, kind, kind.value, wire, watch, stop, trusts))
        case CoolDownRequest(duration_s=duration_s):
            with nullcontext() if _is_virtual(rig) else link.at_once():
                return rig.cool_down(duration_s)
        case SwitchOffRequest():
            return rig.enter_safe_state()
        case LatchRequest():
            return rig.latch.read()
        case ClearFaultsRequest():
            return rig.clear_faults()


def _counts(loop: LoopMetrics) -> DrivenRun:
    return DrivenRun(loop.missed_deadlines)


def _driven(request: DriveRequest, rig: Rig, link: ScriptLink) -> DrivenRun:
    """Run the user's controller. If its `update` was slow, a trip gets a note, and a complete run gets a caveat."""
    config = rig.config
    pace = Pace(rig.period_s, stale_after_s(config), _is_virtual(rig))
    own = OwnController(request.controller, request.duration_s, config.limits.current_max_a, link.at_once, pace)
    try:
        loop = drive(request.log_file, rig, own, RunKind.OWN_CONTROLLER, own.name, request.wire, link.watch)
    except TripError as trip:
        for caveat in own.caveats:
            trip.add_note(caveat)
        raise
    counts = _counts(loop)
    return counts._replace(controller=own.controller if _is_transferable(own.controller) else None, caveats=own.caveats)


def _is_transferable(controller: Any) -> bool:
    """Return True if the controller can be pickled and restored: not if, for example, it holds an open file."""
    try:
        pickle.loads(dumps(controller))  # noqa: S301 (some objects can be pickled, but not restored)
    except Exception:  # noqa: BLE001 (pickling runs code of the user)
        return False
    return True


if __name__ == "__main__":
    serve(ScriptLink(int(sys.argv[1])))
