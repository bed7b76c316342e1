"""The experiments of commands, scripts and notebooks: excitation, manual step, tracking, run of the user's controller.

Each experiment is checked before the wire is heated, and recorded in a log. `Watch` lets the caller show the run.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path

from smadrive.control.controllers.interface import Command, Controller
from smadrive.control.controllers.step import ManualStep
from smadrive.control.feedforward.displacement import DisplacementInverse, HysteresisInverse
from smadrive.control.loop import LoopMetrics, StopRequested, Tick, TickHandler, never
from smadrive.control.references.reference import Reference
from smadrive.control.references.shapes import parse_reference
from smadrive.errors import ProtocolError, TransportError
from smadrive.files.csv_table import read_table
from smadrive.files.kinds import TABLE
from smadrive.identification.excitation import Excitation, check_may_excite
from smadrive.rig.checks.limits import check_step
from smadrive.rig.controllers import step_controller
from smadrive.rig.ports.board_calibration import board_constants
from smadrive.rig.rig import Rig
from smadrive.rig.supervision import wire_checks
from smadrive.runs.cycling.cycles import CycleEvents, least_current_a
from smadrive.runs.health.assessment import expected_of, wire_file_of
from smadrive.runs.run_kind import RunKind
from smadrive.runs.run_log import (
    BOARD_CONSTANTS,
    WIRE_FILE,
    TickRecorder,
    record_controller,
    record_excitation,
    record_step,
    record_tracking,
    reference_text,
)
from smadrive.runs.tracking_plan import PlannedTracking
from smadrive.safety.temperature_by_resistance import always
from smadrive.wire.cold_wire import cold_wire_caveats
from smadrive.wire.identified_wire import IdentifiedWire
from smadrive.wire.wire_model import travel_mm

LOST_S = 5.0
"""An observation without a measurement for this time ends with the error of the last exchange."""

Watch = Callable[[TickRecorder, float], AbstractContextManager[TickHandler]]
"""Takes the recorder of the open log, and the duration of the run in s. Returns a context manager.

The context yields a function. The loop calls this function with each tick. The function records the tick, and may show
it.
"""


def plan_excitation(rig: Rig) -> Excitation:
    """Return the identification experiment of `rig` from its present temperature. Nothing is heated.

    ConfigError when the experiment is impossible.
    """
    measured = rig.measure()
    excitation = rig.excitation(measured.temperature_c)
    check_may_excite(excitation, rig.nominal_balance, rig.config.limits.current_max_a, measured)
    return excitation


def excite(log_file: Path, rig: Rig, excitation: Excitation, watch: Watch, **notes: str) -> LoopMetrics:
    """Run an identification experiment and record it in `log_file`, with `notes`. TripError after a trip."""
    wire_file = Path(rig.config.model).absolute() if rig.config.model else None
    notes |= {WIRE_FILE: str(wire_file)} if wire_file is not None and os.path.isfile(wire_file) else {}
    notes |= {"caveats": json.dumps(rig.caveats)} if rig.caveats else {}
    with (
        record_excitation(log_file, rig, excitation, **notes) as recorder,
        watch(recorder, excitation.duration_s) as record,
    ):
        return rig.excite(excitation, record)


def observe(rig: Rig, duration_s: float, record: TickHandler, is_ended: StopRequested) -> None:
    """Measure in every period of the rig, without arming the heater, and pass every measurement to `record`.

    The observation ends after `duration_s`, or when `is_ended` returns True. A lost exchange is left out. Its error is
    raised if no exchange has succeeded for `LOST_S`.
    """
    clock = rig.clock
    begun_s = fresh_s = clock.now_s()
    number = 0
    while number * rig.period_s <= duration_s and not is_ended():
        due_s = begun_s + number * rig.period_s
        clock.sleep_until(due_s)
        late_s = clock.now_s() - due_s
        try:
            measurement = rig.measure()
        except (TransportError, ProtocolError):
            if clock.now_s() - fresh_s > LOST_S:
                raise
        else:
            fresh_s = measurement.time_s
            record(Tick(fresh_s - begun_s, late_s, measurement, Command(0.0)))
        number += 1 + int((clock.now_s() - due_s) / rig.period_s)


def heat(log_file: Path, rig: Rig, step: ManualStep, watch: Watch) -> LoopMetrics:
    """Run a manual step and record it in `log_file`, with its caveats and the calibration constants of the board.

    ConfigError if the step exceeds a limit of the rig, TripError after a trip.
    """
    notes = {"caveats": json.dumps(planned_step_caveats(rig, step))}
    if constants := board_constants(rig.devices.values()):
        notes |= {BOARD_CONSTANTS: json.dumps(constants)}
    controller = step_controller(rig.config, step, rig.nominal_balance)
    with (
        record_step(log_file, rig, step, **notes) as recorder,
        watch(recorder, step.duration_s) as record,
    ):
        return rig.drive(controller, rig.nominal_balance, record)


def planned_step_caveats(rig: Rig, step: ManualStep) -> tuple[str, ...]:
    """Return the caveats of a manual step that begins at the present temperature, one sentence each. Nothing is heated.

    ConfigError if the step exceeds a limit of the rig.
    """
    caveats = check_step(step, rig.config, rig.data_sheet)
    return (*caveats, *cold_wire_caveats(rig.measure().temperature_c, rig.data_sheet.ambient_c))


def track(
    log_file: Path,
    rig: Rig,
    plan: PlannedTracking,
    watch: Watch,
    inverse: DisplacementInverse | None = None,
    **notes: str,
) -> LoopMetrics:
    """Run `plan` and record it in `log_file`, with `notes`. TripError after a trip.

    `inverse` is the feedforward, by default the inverse of the hysteresis model.
    """
    wire, source = plan.wire, plan.displacement_from
    inverse = inverse or HysteresisInverse(wire.model)
    notes |= {"given_reference": reference_text(plan.given), "caveats": json.dumps(plan.caveats)}
    notes |= {} if plan.cycling is None else {"cycling": plan.cycling.text()}
    notes |= {} if plan.wire_file is None else {WIRE_FILE: str(plan.wire_file)}
    with (
        record_tracking(log_file, rig, plan.nearest, wire, inverse, source, **notes) as recorder,
        watch(recorder, plan.nearest.duration_s) as record,
    ):
        if plan.cycling is None:
            return rig.track(plan.nearest, wire, inverse, record, plan.expected, source)
        limit_a, is_measured = rig.config.limits.current_max_a, rig.measures("resistance")
        least_a = least_current_a(limit_a, measures_resistance=is_measured)
        cycles = CycleEvents(recorder.event, plan.nearest, plan.cycling, travel_mm(wire.model), least_a)

        def record_cycles(tick: Tick) -> None:
            cycles.tick(tick)
            record(tick)

        loop = rig.track(plan.nearest, wire, inverse, record_cycles, plan.expected, source)
        cycles.finish()
        return loop


def drive(
    log_file: Path,
    rig: Rig,
    controller: Controller,
    kind: RunKind,
    name: str,
    identified: IdentifiedWire,
    watch: Watch,
    stop_requested: StopRequested = never,
    trusts_sensor: Callable[[], bool] = always,
) -> LoopMetrics:
    """Run a controller of a script on the identified wire and record it in `log_file`. TripError after a trip.

    `kind` is OWN_CONTROLLER or SERVO. The run also ends when `stop_requested` returns True. While `trusts_sensor`
    returns False, the supervisor does not use the displacement.
    """
    wire, wire_file = identified.wire_model(rig.nominal_balance), wire_file_of(identified)
    checks = wire_checks(wire, rig.config.displacement_from, expected_of(identified), trusts_sensor)
    notes = {} if wire_file is None else {WIRE_FILE: str(wire_file)}
    with (
        record_controller(log_file, rig, kind, wire, name, controller.duration_s, **notes) as recorder,
        watch(recorder, controller.duration_s) as record,
    ):
        return rig.drive(controller, wire.balance, record, checks, stop_requested)


def read_reference(text: str) -> Reference:
    """Return the reference that `text` names.

    `text` is the path of a CSV file with the columns `time_s` and `displacement_mm`, or a shape such as
    `sine:low_mm=2,high_mm=9,period_s=56`.
    """
    path = Path(text)
    if TABLE.has_ending(path) or os.path.isfile(path):
        table = read_table(path)
        return Reference.from_samples(table.column("time_s"), table.column("displacement_mm"))
    return parse_reference(text)
