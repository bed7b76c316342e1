"""The log of one run of a rig: a row for each tick, events for faults and limits, and the metadata of the run.

The log holds all measured values that the controller used and every command that it returned, so that a replay can
repeat the run.
"""

from __future__ import annotations

import json
import platform
from collections.abc import Callable, Mapping
from dataclasses import asdict
from importlib.metadata import version
from math import inf, isfinite
from pathlib import Path

from smadrive.control.controllers.interface import Command
from smadrive.control.controllers.source_events import SourceEvents
from smadrive.control.controllers.step import ManualStep
from smadrive.control.feedforward.displacement import DisplacementInverse, HysteresisInverse
from smadrive.control.loop import Tick
from smadrive.control.references.reference import Reference
from smadrive.errors import StoppedError
from smadrive.identification.excitation import Excitation
from smadrive.measurement import DisplacementFrom, Measurement
from smadrive.rig.rig import Rig
from smadrive.runs.columns import COLUMNS, row_getter
from smadrive.runs.log.reader import STOP
from smadrive.runs.log.recorder import Recorder
from smadrive.runs.log.writer import GROWTH_ROWS
from smadrive.runs.run_kind import RunKind
from smadrive.wire.identified_wire import IdentifiedWire
from smadrive.wire.wire_model import WireModel

_row = row_getter(COLUMNS)

WIRE_FILE = "wire_file"
"""Name of the metadata text with the path of the model file. A log has no such text if its run used no model file."""

BOARD_CONSTANTS = "board_constants"
"""Name of the metadata text with serial number and calibration constants of the board during a manual step, as JSON."""

_PACKAGES = ("smadrive", "numpy", "scipy", "h5py", "pymodbus", "pyserial")


class TickRecorder(Recorder):
    """Records the ticks of a loop: a row for each tick, and events.

    An event is written when the faults change, when a limit acts for the first time, and when the source of the
    displacement changes (a session reports this itself). `stopped_by` returns the name of the program that has
    requested an emergency stop; it is empty without such a request.
    """

    def __init__(self, path: Path, metadata: Mapping[str, str], rows: int, stopped_by: Callable[[], str] = str) -> None:
        super().__init__(path, tuple(COLUMNS), metadata, rows)
        self._stopped_by = stopped_by
        self._reported_limits: set[str] = set()
        self._faults: tuple[str, ...] = ()
        self._source = None if metadata["kind"] == RunKind.SESSION else SourceEvents()

    def tick(self, tick: Tick) -> None:
        """Record one tick of the loop. DataError when the log cannot be written."""
        self.row(_row(tick))
        self._report_faults(tick.measurement)
        self._report_limits(tick.measurement)
        self._report_source(tick.command)

    def _cause(self, error: BaseException) -> str:
        is_interruption = isinstance(error, KeyboardInterrupt | SystemExit)
        if (is_interruption or isinstance(error, StoppedError)) and (program := self._stopped_by()):
            return f"{STOP}: {program}"
        return super()._cause(error)

    def _report_faults(self, measurement: Measurement) -> None:
        faults = measurement.device_faults
        if measurement.temperature_fault is not None:
            faults = (*faults, f"thermocouple {measurement.temperature_fault}")
        if measurement.supply_fault is not None:
            faults = (*faults, f"current or voltage {measurement.supply_fault}")
        if faults != self._faults:
            self._faults = faults
            self.event(f"faults: {', '.join(faults) or 'cleared'}")

    def _report_limits(self, measurement: Measurement) -> None:
        for limit in measurement.limits:
            if limit not in self._reported_limits:
                self._reported_limits.add(limit)
                self.event(f"limited by {limit} for the first time")

    def _report_source(self, command: Command) -> None:
        if self._source is not None:
            by_sensor = not (command.uses_resistance or command.sensor_replaced)
            for event in self._source.update(command, by_sensor=by_sensor):
                self.event(event)


def record_excitation(path: Path, rig: Rig, excitation: Excitation, **notes: str) -> TickRecorder:
    """Create the log of an identification experiment, and return its recorder. `notes` are further metadata."""
    metadata = {"excitation": json.dumps(asdict(excitation)), **notes}
    return _open(path, rig, RunKind.EXCITATION, metadata, excitation.duration_s)


def record_observation(path: Path, rig: Rig, duration_s: float) -> TickRecorder:
    """Create the log of an observation without heat, and return its recorder."""
    return _open(path, rig, RunKind.OBSERVATION, {}, duration_s)


def record_step(path: Path, rig: Rig, step: ManualStep, **notes: str) -> TickRecorder:
    """Create the log of a manual step, and return its recorder. `notes` are further metadata."""
    return _open(path, rig, RunKind.STEP, {"step": json.dumps(asdict(step)), **notes}, step.duration_s)


def record_tracking(
    path: Path,
    rig: Rig,
    reference: Reference,
    wire: WireModel,
    inverse: DisplacementInverse,
    displacement_from: DisplacementFrom | None = None,
    **notes: str,
) -> TickRecorder:
    """Create the log of a tracking run, and return its recorder. `notes` are further metadata, for example a seed.

    `displacement_from` replaces the source of the displacement in the rig file.
    """
    metadata = {
        "reference": reference_text(reference),
        "wire": IdentifiedWire.of(wire).text(),
        "inverse": "hysteresis" if isinstance(inverse, HysteresisInverse) else "plain map",
        "displacement_from": (displacement_from or rig.config.displacement_from).value,
    }
    return _open(path, rig, RunKind.TRACKING, {**metadata, **notes}, reference.duration_s)


def record_controller(
    path: Path, rig: Rig, kind: RunKind, wire: WireModel, name: str, duration_s: float, **notes: str
) -> TickRecorder:
    """Create the log of a run of the controller `name` of a script on the wire, and return its recorder.

    `kind` is OWN_CONTROLLER or SERVO. `notes` are further metadata.
    """
    metadata = {"controller": name, "wire": IdentifiedWire.of(wire).text(), **notes}
    return _open(path, rig, kind, metadata, duration_s)


def record_session(path: Path, rig: Rig, wire: IdentifiedWire, **notes: str) -> TickRecorder:
    """Create the log of a tuning session that begins with `wire`, and return its recorder.

    `notes` are further metadata.
    """
    return _open(path, rig, RunKind.SESSION, {"wire": wire.text(), **notes}, inf)


def reference_text(reference: Reference) -> str:
    """Return the reference, including its approach, as JSON."""
    return json.dumps(
        {
            "times_s": reference.times_s.tolist(),
            "displacement_mm": reference.displacement_mm.tolist(),
            "scored_from_s": reference.scored_from_s,
            "endless": reference.endless,
            "repeats": reference.repeats,
        }
    )


def _open(path: Path, rig: Rig, kind: RunKind, metadata: Mapping[str, str], duration_s: float) -> TickRecorder:
    of_the_rig = {
        "kind": kind.value,
        "rig": rig.config.model_dump_json(),
        "data_sheet": rig.data_sheet.model_dump_json(),
        "nominal_balance": json.dumps(asdict(rig.nominal_balance)),
        "devices": json.dumps({name: str(identity) for name, identity in rig.identities.items()}),
        "profiles": json.dumps({name: device.profile.model_dump(mode="json") for name, device in rig.devices.items()}),
        "versions": json.dumps({"python": platform.python_version(), **{name: version(name) for name in _PACKAGES}}),
        "machine": platform.platform(),
    }
    rows = int(duration_s / rig.period_s) + 1 if isfinite(duration_s) else GROWTH_ROWS
    return TickRecorder(path, {**of_the_rig, **metadata}, rows, lambda: rig.stop.requested_by)
