"""Metrics of a manual step: the wire at the end of the step, and over the whole step."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from smadrive.runs.log.reader import Log
from smadrive.runs.metrics.caveats import measured_caveats
from smadrive.runs.metrics.run import run_metrics
from smadrive.runs.metrics.series import MEASURABLE, of_finite
from smadrive.runs.run_metadata import rig_config_of, step_of

END_S = 1.0
"""The value at the end of a manual step is the median over this last part of the step, in seconds."""

NOT_REACHED_K = 2.0
"""A step has not reached its setpoint if it ends more than this from the setpoint, in K."""


@dataclass(frozen=True)
class StepMetrics:
    """The wire at the end of a manual step, and over the whole step. Unknown values are NaN.

    The values at the end are medians over the last second, or the last sample if the step ended early. The
    resistance includes leads and clamps.
    """

    temperature_end_c: float
    temperature_max_c: float
    displacement_end_mm: float
    current_end_a: float
    resistance_end_ohm: float
    energy_j: float


def step_metrics(log: Log) -> StepMetrics:
    """Return the metrics of a manual step. DataError when the log has no row."""
    whole = run_metrics(log)
    time_s = log.column("time_s")
    names = ("temperature_c", "displacement_mm", "current_a", "voltage_v")
    is_end = time_s > time_s[-1] - END_S if not log.ended_by else time_s == time_s[-1]
    temperature_c, displacement_mm, current_a, voltage_v = (log.column_with_gaps(name)[is_end] for name in names)
    flows = current_a >= MEASURABLE * rig_config_of(log).limits.current_max_a
    return StepMetrics(
        of_finite(np.median, temperature_c),
        whole.temperature_max_c,
        of_finite(np.median, displacement_mm),
        of_finite(np.median, current_a),
        of_finite(np.median, voltage_v[flows] / current_a[flows]),
        whole.energy_j,
    )


def step_caveats(log: Log) -> tuple[str, ...]:
    """Return reasons to distrust a manual step: a temperature that was not reached, or what was measured."""
    end_c, setpoint_c = step_metrics(log).temperature_end_c, step_of(log).temperature_c
    if setpoint_c is None or not abs(end_c - setpoint_c) > NOT_REACHED_K:
        return measured_caveats(log)
    return (f"the step ended at {end_c:.1f} °C, and its setpoint was {setpoint_c:g} °C", *measured_caveats(log))
