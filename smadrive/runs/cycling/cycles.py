"""The metrics of each cycle of a run that repeats its reference.

A cycle is one repetition of the reference. A continuation goes on with the numbers of the previous part, and its log
holds the metrics of all earlier cycles. The resistance at rest is measured near the cold end of the reference, from
samples with enough current; it includes leads and clamps. It is unknown if the heat source computes the voltage.
"""

from __future__ import annotations

import json
from array import array
from collections.abc import Callable
from dataclasses import asdict, dataclass
from math import inf, nan
from typing import Any

import numpy as np
from numpy.typing import NDArray

from smadrive.control.loop import Tick
from smadrive.control.references.reference import Reference
from smadrive.numerics.arrays import FloatArray
from smadrive.runs.log.reader import Log
from smadrive.runs.metrics.series import MEASURABLE, energy_j, of_finite, rms_and_max
from smadrive.runs.metrics.tracking_error import MOST_REPLACED, measured_mm
from smadrive.runs.run_metadata import measures_resistance, reference_of, rig_config_of, wire_of
from smadrive.wire.wire_model import Travel, travel_mm

REST_SHARE = 0.05
"""The wire counts as at rest while the setpoint is within this share of the reference's span from the cold end."""

LEAST_SAMPLES = 3
"""A resistance at rest is computed from at least this number of samples."""

COLUMNS_OF_A_CYCLE = ("time_s", "setpoint_mm", "displacement_mm", "temperature_c", "current_a", "voltage_v")
"""The columns that the metrics of a cycle need. The displacement is NaN where the sensor was replaced."""

EVENT = "cycle "
"""The beginning of the event that a run writes after each cycle."""


@dataclass(frozen=True)
class CycleMetrics:
    """The metrics of one cycle. Unknown values are NaN.

    cycle                       number of the cycle, from 1
    stroke_mm                   highest minus lowest measured displacement; unknown if an end was not measured
    rms_percent, max_percent    RMS and largest tracking error, in % of the model's stroke; unknown if most of the
                                displacement was not measured
    rest_ohm                    resistance at rest
    energy_j                    electrical energy that the wire received
    """

    cycle: int
    stroke_mm: float
    rms_percent: float
    max_percent: float
    rest_ohm: float
    energy_j: float
    temperature_max_c: float

    def event_text(self) -> str:
        """Return the metrics as the text of an event of the log."""
        values = (
            f"stroke {self.stroke_mm:.4g} mm",
            f"RMS error {self.rms_percent:.3g} %",
            f"largest error {self.max_percent:.3g} %",
            f"at rest {self.rest_ohm:.4g} Ω",
            f"energy {self.energy_j:.4g} J",
            f"at most {self.temperature_max_c:.4g} °C",
        )
        return f"{EVENT}{self.cycle}: {', '.join(values)}"


@dataclass(frozen=True)
class Cycling:
    """The plan of a run that repeats its reference: `total` cycles, of which `before` are done already.

    `continues` is the log of the previous part; it is empty for the first part.
    """

    total: int
    before: tuple[CycleMetrics, ...] = ()
    continues: str = ""

    @property
    def remaining(self) -> int:
        """The number of cycles that are left."""
        return self.total - len(self.before)

    def text(self) -> str:
        """Return the plan as JSON, as the log stores it."""
        before = [{name: _or_none(value) for name, value in asdict(one).items()} for one in self.before]
        return json.dumps({"total": self.total, "continues": self.continues, "before": before})


def cycling_of(log: Log) -> Cycling | None:
    """Return the plan of a run that repeats its reference, None for another run. DataError when the plan is invalid."""
    return log.parsed("cycling", _cycling) if "cycling" in log.metadata else None


def cycles_of(log: Log) -> list[CycleMetrics]:
    """Return the metrics of each complete cycle, with those of the previous parts; empty for a run without cycles.

    A measurement that tripped does not count: it may be invalid.
    """
    cycling, log = cycling_of(log), log.without_trips()
    if cycling is None or not log.column("time_s").size:
        return [] if cycling is None else list(cycling.before)
    reference, measure = reference_of(log), _measure_of(log)
    rows = np.column_stack([log.column_with_gaps(name) for name in COLUMNS_OF_A_CYCLE])
    rows[:, COLUMNS_OF_A_CYCLE.index("displacement_mm")] = measured_mm(log)
    numbers = _numbers(reference, rows[:, 0])
    complete = _complete(reference, float(rows[-1, 0]), 1.5 / rig_config_of(log).rate_hz)
    edges = np.searchsorted(numbers, np.arange(complete + 1))
    first = len(cycling.before) + 1
    own = [measure(first + n, rows[edges[n] : edges[n + 1]]) for n in range(complete)]
    return [*cycling.before, *own]


class CycleEvents:
    """Writes an event after each cycle of a run. Call `tick` with every tick, `finish` after a complete run.

    `write` takes the text of an event. `travel` is that of the wire's model. `least_current_a` is
    the least current of a sample that shows the resistance at rest, A.
    """

    def __init__(
        self,
        write: Callable[[str], None],
        reference: Reference,
        cycling: Cycling,
        travel: Travel,
        least_current_a: float,
    ) -> None:
        self._write = write
        self._reference = reference
        self._first = len(cycling.before) + 1
        self._travel = travel
        self._least_current_a = least_current_a
        self._number = 0
        self._values = array("d")  # turns into rows without a copy, so that a long cycle makes no tick late

    def tick(self, tick: Tick) -> None:
        """Take one tick. If it is the first tick of a new cycle, write the event of the cycle before."""
        number = int(_numbers(self._reference, np.array([tick.time_s]))[0])
        if number > self._number:
            self.finish()
            self._number = number
        if number >= 0:
            measured = tick.measurement
            values = measured.temperature_c, measured.current_a, measured.voltage_v
            self._values.extend((tick.time_s, tick.command.setpoint_mm, tick.measured_mm, *values))

    def finish(self) -> None:
        """Write the event of the cycle that has ended."""
        if self._values:
            rows = np.frombuffer(self._values).reshape(-1, len(COLUMNS_OF_A_CYCLE))
            metrics = metrics_of(self._first + self._number, rows, self._travel, self._least_current_a)
            self._write(metrics.event_text())
            self._values = array("d")


def least_current_a(current_max_a: float, *, measures_resistance: bool) -> float:
    """Return the least current with which voltage and current give the resistance, A; inf if they are not measured."""
    return MEASURABLE * current_max_a if measures_resistance else inf


def metrics_of(number: int, rows: FloatArray, travel: Travel, least_current_a: float) -> CycleMetrics:
    """Return the metrics of the cycle `number`. `travel` is that of the wire's model.

    `rows` has one row for each sample, with the columns `COLUMNS_OF_A_CYCLE`.
    """
    time_s, setpoint_mm, displacement_mm, temperature_c, current_a, voltage_v = rows.T
    error = 100.0 * (setpoint_mm - displacement_mm) / travel.stroke_mm
    height = setpoint_mm if travel.hot_mm > travel.cold_mm else -setpoint_mm
    is_measured = np.isfinite(displacement_mm)
    has_ends = of_finite(np.ptp, np.where(is_measured, setpoint_mm, nan)) >= (1.0 - REST_SHARE) * np.ptp(setpoint_mm)
    is_known = np.mean(is_measured) >= 1.0 - MOST_REPLACED
    is_rest = height <= height.min() + REST_SHARE * np.ptp(height)
    is_rest &= current_a >= least_current_a
    rest_ohm = (voltage_v / np.where(is_rest, current_a, 1.0))[is_rest]
    rest_ohm = rest_ohm[np.isfinite(rest_ohm)]
    return CycleMetrics(
        number,
        of_finite(np.ptp, displacement_mm) if has_ends else nan,
        *(rms_and_max(error) if is_known else (nan, nan)),
        float(np.median(rest_ohm)) if rest_ohm.size >= LEAST_SAMPLES else nan,
        energy_j(time_s, current_a, voltage_v),
        of_finite(np.max, temperature_c),
    )


def _measure_of(log: Log) -> Callable[[int, FloatArray], CycleMetrics]:
    limit_a = rig_config_of(log).limits.current_max_a
    travel, least_a = (
        travel_mm(wire_of(log).model),
        least_current_a(limit_a, measures_resistance=measures_resistance(log)),
    )
    return lambda number, rows: metrics_of(number, rows, travel, least_a)


def _numbers(reference: Reference, time_s: FloatArray) -> NDArray[np.int64]:
    """Return the number of the cycle at each time, from 0; -1 in the approach. The last cycle includes its end."""
    numbers = np.floor((time_s - reference.scored_from_s) / reference.cycle_s).astype(np.int64)
    return np.clip(numbers, -1, reference.repeats - 1)


def _complete(reference: Reference, last_s: float, tolerance_s: float) -> int:
    """Return the number of complete cycles of a run whose last sample was at `last_s`.

    A cycle counts as complete from `tolerance_s` before its end.
    """
    cycles = (last_s + tolerance_s - reference.scored_from_s) / reference.cycle_s
    return min(max(int(cycles), 0), reference.repeats)


def _cycling(values: dict[str, Any]) -> Cycling:
    before = tuple(_cycle(one) for one in values["before"])
    return Cycling(int(values["total"]), before, str(values["continues"]))


def _cycle(values: dict[str, Any]) -> CycleMetrics:
    metrics = {name: nan if value is None else float(value) for name, value in values.items() if name != "cycle"}
    return CycleMetrics(int(values["cycle"]), **metrics)


def _or_none(value: float) -> float | None:
    return value if np.isfinite(value) else None
