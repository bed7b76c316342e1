"""A recorded run once more: the same controller on the recorded measurements, its commands beside the recorded ones.

With nothing changed the replay repeats the record bit for bit. What differs shows what a change of the software did, or
with another wire's model, what that model would have made of the same measurements. The measurements stay those that
the recorded commands led to: how the wire would have answered other commands is a question for the simulator.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import inf, nan

import numpy as np
from numpy.typing import NDArray

from smadrive.control.controllers.temperature import Command, Controller
from smadrive.control.feedforward.displacement import HysteresisInverse
from smadrive.errors import DataError
from smadrive.hysteresis import HysteresisModel
from smadrive.measurement import Measurement
from smadrive.rig.controllers import excitation_controller, tracking_controller
from smadrive.runs.log.reader import Log
from smadrive.runs.run_log import COLUMNS
from smadrive.runs.run_metadata import (
    logged_excitation,
    logged_reference,
    logged_rig,
    logged_wire,
    nominal_balance,
)
from smadrive.wire.identified_wire import IdentifiedWire
from smadrive.wire.wire_model import travel_mm

Array = NDArray[np.float64]

ANSWERS = {name: path.removeprefix("command.") for name, path in COLUMNS.items() if path.startswith("command.")}
"""The columns that a controller answered, and what they are called in its command."""

MEASURED = {name: path.removeprefix("measurement.") for name, path in COLUMNS.items() if "measurement." in path}


@dataclass(frozen=True)
class Difference:
    """How far a signal of the replay is from the recorded one; `first_s` is when they part, inf: never."""

    max: float
    rms: float
    first_s: float


@dataclass(frozen=True)
class Replay:
    """The replayed signals, and their differences from the recorded ones."""

    time_s: Array
    signals: dict[str, Array]
    differences: dict[str, Difference]

    @property
    def exact(self) -> bool:
        """Whether every signal is the recorded one, bit for bit."""
        return all(difference.first_s == inf for difference in self.differences.values())


def replay(log: Log, wire: IdentifiedWire | None = None) -> Replay:
    """Replay `log` with the wire it was run with, or with `wire`. DataError when the log does not tell enough."""
    if log.column("time_s").size == 0:
        raise DataError(f"{log.path}: no tick was recorded: there is nothing to replay")
    controller = _controller(log, wire)
    commands = list(_commands(log, controller))
    signals = {name: np.array([getattr(command, key) for command in commands]) for name, key in ANSWERS.items()}
    time_s = log.column("time_s")
    differences = {name: _difference(log.signal(name), values, time_s) for name, values in signals.items()}
    return Replay(time_s, signals, differences)


def _commands(log: Log, controller: Controller) -> Iterator[Command]:
    """What the controller answers to each sample. DataError for a sample that it cannot compute with."""
    for time_s, sample, dt_s in _samples(log):
        try:
            yield controller.update(time_s, sample, dt_s)
        except (ArithmeticError, ValueError) as error:
            raise DataError(
                f"{log.path}: the sample at {time_s:g} s cannot be replayed ({error}): record it again"
            ) from None


def prediction_percent(log: Log, estimated_mm: Array, model: HysteresisModel) -> float:
    """RMS of estimated minus measured displacement, in % of the stroke of `model`; NaN when none was measured."""
    cold_mm, hot_mm = travel_mm(model)
    missed = (estimated_mm - log.signal("displacement_mm")) / abs(hot_mm - cold_mm)
    return float(100.0 * np.sqrt(np.mean(missed**2)))


def _controller(log: Log, wire: IdentifiedWire | None) -> Controller:
    config = logged_rig(log)
    if log.about.get("kind") == "excitation":
        if wire is not None:
            raise DataError(f"{log.path}: an excitation runs without a model: replay it without --model")
        return excitation_controller(config, logged_excitation(log), nominal_balance(log))
    if wire is None and log.about.get("inverse") != "hysteresis":
        raise DataError(f"{log.path}: ran with a plain map, which no log keeps: give --model to replay it with a model")
    stepped = (wire or logged_wire(log)).wire_model()
    inverse = HysteresisInverse(stepped.model)
    return tracking_controller(config, logged_reference(log), stepped.model, stepped.balance, inverse)


def _samples(log: Log) -> Iterator[tuple[float, Measurement, float]]:
    """What the loop handed to its controller: time, measurement, period."""
    last_s = -1.0 / logged_rig(log).rate_hz
    for values in zip(*(log.signal(name).tolist() for name in ("time_s", *MEASURED)), strict=True):
        time_s, *measured = values
        yield time_s, Measurement(time_s, **dict(zip(MEASURED.values(), measured, strict=True))), time_s - last_s
        last_s = time_s


def _difference(recorded: Array, replayed: Array, time_s: Array) -> Difference:
    """NaN equals NaN: a controller that has no such signal."""
    parted = ~((recorded == replayed) | (np.isnan(recorded) & np.isnan(replayed)))
    if not parted.any():
        return Difference(0.0, 0.0, inf)
    distance = np.where(parted, replayed - recorded, 0.0)
    known = distance[np.isfinite(distance)]
    largest, rms = (float(np.max(np.abs(known))), float(np.sqrt(np.mean(known**2)))) if known.size else (nan, nan)
    return Difference(largest, rms, float(time_s[np.argmax(parted)]))
