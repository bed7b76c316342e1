"""Replays a recorded run: gives the recorded measurements to the controller, and compares the commands with the log.

If nothing has changed, the replayed commands equal the recorded ones bit for bit. A difference shows the effect of a
change of the software, or of another model of the wire. The measurements stay the recorded ones: a replay does not show
how the wire would have reacted to other commands. Use the simulator for that question.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from math import inf, nan
from typing import TypeVar

import numpy as np

from smadrive.control.controllers.interface import Command, Controller
from smadrive.control.controllers.tracking import DISPLACEMENT_NOISE
from smadrive.control.estimation.observer import WireObserver
from smadrive.control.estimation.prediction import DisplacementPrediction
from smadrive.control.feedforward.displacement import HysteresisInverse
from smadrive.errors import DataError
from smadrive.measurement import DisplacementFrom, Measurement
from smadrive.numerics.arrays import FloatArray
from smadrive.rig.controllers import (
    excitation_controller,
    step_controller,
    tracking_controller,
    tracking_settings,
)
from smadrive.runs.columns import fields_of
from smadrive.runs.log.reader import Log
from smadrive.runs.metrics.tracking_error import measured_mm
from smadrive.runs.run_kind import RunKind
from smadrive.runs.run_metadata import (
    displacement_source_of,
    excitation_of,
    nominal_balance,
    reference_of,
    rig_config_of,
    step_of,
    wire_of,
)
from smadrive.wire.identified_wire import IdentifiedWire
from smadrive.wire.wire_model import WireModel, travel_mm

COMMAND_FIELDS = fields_of("command")
"""The columns that a controller computes: name of the column to attribute of `Command`."""

MEASUREMENT_FIELDS = fields_of("measurement")

LIMITED = ("limited",)
"""The limits of a recorded sample whose output was held back: a log does not name them."""

RECORD = "record the run again"

Result = TypeVar("Result")

NOT_REPLAYED = {
    RunKind.SESSION: (
        "a tuning session cannot be replayed, because its tuning and its reference changed while it ran",
        "save the tuning on the page, and record it with `smadrive run`",
    ),
    RunKind.OBSERVATION: (
        "nothing was controlled while the rig was observed",
        "replay the log of `run`, `excite` or `heat`",
    ),
    RunKind.OWN_CONTROLLER: (
        "a controller of the user ran, and a log does not hold its code",
        "call the controller's `update` with the rows of the log, in Python",
    ),
    RunKind.SERVO: (
        "the motions of a servo came from a script, and a log does not hold them",
        "track a reference with `smadrive run`, and replay its log",
    ),
}
"""The reason and the cure for kinds of runs that cannot be replayed."""


@dataclass(frozen=True)
class Difference:
    """Difference between a replayed column and the recorded one, in the unit of the column.

    max        largest magnitude, without samples in which only one of the two columns is NaN
    rms        root mean square over the same samples
    first_s    time of the first sample that differs, s; inf when no sample differs

    `max` and `rms` are NaN if in every sample that differs one of the columns is NaN.
    """

    max: float
    rms: float
    first_s: float


@dataclass(frozen=True)
class Replay:
    """The replayed columns that a controller computes, and their differences from the recorded ones, by column name.

    Logs of older versions lack some of these columns. Such a column is left out.
    """

    time_s: FloatArray
    columns: dict[str, FloatArray]
    differences: dict[str, Difference]

    @property
    def exact(self) -> bool:
        """True if every replayed column equals the recorded one, bit for bit."""
        return all(difference.first_s == inf for difference in self.differences.values())


def replay(log: Log, wire: IdentifiedWire | None = None) -> Replay:
    """Replay the run in `log` with `wire`, or with the wire in the log if `wire` is None.

    DataError when the log lacks data for a replay, or when `wire` is given for an excitation or a manual step.
    """
    time_s = log.column("time_s")
    if time_s.size == 0:
        raise DataError("no tick was recorded", where=log.path, cure=RECORD)
    commands = list(_commands(log, _controller(log, wire)))
    recorded = {name: key for name, key in COMMAND_FIELDS.items() if name in log.columns}
    columns = {name: np.array([getattr(command, key) for command in commands]) for name, key in recorded.items()}
    differences = {name: _difference(log.column_with_gaps(name), values, time_s) for name, values in columns.items()}
    return Replay(time_s, columns, differences)


def _commands(log: Log, controller: Controller) -> Iterator[Command]:
    """Yield the controller's command for each sample. As in the run, it does not get a sample that tripped."""
    command, updated = Command(0.0), _updated(log.without_trips(), controller.update)
    for tripped in log.tripped_rows:
        command = command.after_trip() if tripped else next(updated)
        yield command


def prediction_percent(log: Log, wire: IdentifiedWire | None = None) -> float:
    """Return the RMS of predicted minus measured displacement, in % of the stroke of the model.

    The model is that of `wire`, or that in the log if `wire` is None. It predicts from temperature and power alone. The
    estimate of the run is no prediction: a displacement sensor corrects it.

    The result is NaN when the measurement or the prediction of any sample is missing, or the sensor was replaced. A
    sample that tripped does not count: it may be invalid. DataError when no displacement can be computed.
    """
    log = log.without_trips()
    found_mm, stepped = measured_mm(log), _wire_model(log, wire)
    if not (found_mm.size and np.isfinite(found_mm).all()):
        return nan
    residual = (_predicted_mm(log, stepped) - found_mm) / travel_mm(stepped.model).stroke_mm
    return float(100.0 * np.sqrt(np.mean(residual**2)))


def _wire_model(log: Log, wire: IdentifiedWire | None) -> WireModel:
    """Return the model of `wire`, or of the wire in the log.

    A wire without a heat balance has that of the data sheet, as in a run.
    """
    return (wire or wire_of(log)).wire_model(nominal_balance(log))


def _predicted_mm(log: Log, wire: WireModel) -> FloatArray:
    config = rig_config_of(log)
    settings, noise_mm = tracking_settings(config), DISPLACEMENT_NOISE * abs(wire.travel_mm)
    observer = WireObserver(wire, settings.period_s, wire.balance.assumed_noise_c(settings.noise_c), noise_mm)
    prediction = DisplacementPrediction(wire, observer, settings.current_limit_a)
    return np.fromiter(_updated(log, prediction.update), np.float64)


def _updated(log: Log, update: Callable[[float, Measurement, float], Result]) -> Iterator[Result]:
    """Yield the result of `update` for each sample. DataError when `update` cannot compute it."""
    for time_s, sample, dt_s in _samples(log):
        try:
            yield update(time_s, sample, dt_s)
        except (ArithmeticError, ValueError) as error:
            where = f"{log.path}, sample at {time_s:g} s"
            raise DataError("cannot be computed", where=where, value=error, cure=RECORD) from None


def _controller(log: Log, wire: IdentifiedWire | None) -> Controller:
    if log.kind in NOT_REPLAYED:
        what, cure = NOT_REPLAYED[log.kind]
        raise DataError(what, where=log.path, cure=cure)
    if log.kind is RunKind.TRACKING:
        return _tracking_controller(log, wire)
    if wire is not None:
        what = f"the log of kind '{log.kind.value}' uses no model"
        raise DataError(what, where=log.path, cure="replay it without --model")
    if log.kind is RunKind.STEP:
        return step_controller(rig_config_of(log), step_of(log), nominal_balance(log))
    return excitation_controller(rig_config_of(log), excitation_of(log), nominal_balance(log))


def _tracking_controller(log: Log, wire: IdentifiedWire | None) -> Controller:
    if wire is None and log.metadata.get("inverse") != "hysteresis":
        what = "the run used a plain temperature map instead of a model, and a log does not hold this map"
        raise DataError(what, where=log.path, cure="replay it with a model: --model FILE")
    stepped = _wire_model(log, wire)
    chosen = displacement_source_of(log) or DisplacementFrom.SENSOR
    return tracking_controller(rig_config_of(log), reference_of(log), stepped, HysteresisInverse(stepped.model), chosen)


def _samples(log: Log) -> Iterator[tuple[float, Measurement, float]]:
    """Yield the arguments of each update of the controller: time, measurement, time since the previous update."""
    last_s = -1.0 / rig_config_of(log).rate_hz
    names = ("time_s", "limited", *MEASUREMENT_FIELDS)
    for time_s, limited, *values in zip(*(log.column_with_gaps(name).tolist() for name in names), strict=True):
        fields = dict(zip(MEASUREMENT_FIELDS.values(), values, strict=True))
        yield time_s, Measurement(time_s, host_limits=LIMITED if limited else (), **fields), time_s - last_s
        last_s = time_s


def _difference(recorded: FloatArray, replayed: FloatArray, time_s: FloatArray) -> Difference:
    """Return the difference of two columns. NaN equals NaN: a column that a controller does not compute is NaN."""
    is_different = ~((recorded == replayed) | (np.isnan(recorded) & np.isnan(replayed)))
    if not is_different.any():
        return Difference(0.0, 0.0, inf)
    distance = np.where(is_different, replayed - recorded, 0.0)
    finite = distance[np.isfinite(distance)]
    largest, rms = (float(np.max(np.abs(finite))), float(np.sqrt(np.mean(finite**2)))) if finite.size else (nan, nan)
    return Difference(largest, rms, float(time_s[np.argmax(is_different)]))
