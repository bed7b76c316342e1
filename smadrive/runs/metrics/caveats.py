"""Reasons to distrust the content of a log, or the metrics of its run."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from smadrive.runs.log.reader import Log
from smadrive.runs.metrics.series import MEASURABLE, of_finite
from smadrive.runs.metrics.thermocouple_noise import noise_caveats
from smadrive.runs.metrics.tracking_error import (
    MOST_REPLACED,
    error_percent,
    has_setpoint,
    measured_mm,
    replaced_share,
    scored_from_s,
)
from smadrive.runs.run_metadata import nominal_balance, rig_config_of, texts_of, wire_of
from smadrive.wire.data_sheet import resistance_caveats
from smadrive.wire.wire_model import travel_mm

FEW_MISSING = 0.03
"""Largest share of samples that a working sensor misses. A larger share gives a warning about the metrics."""

DIFFERENCES, DEVIATIONS = ((0.05, 0.2), (0.15, FEW_MISSING)), 3.0
"""A run gets a caveat if the displacement by the resistance differs from another source by more than a difference.

Each pair is such a difference, as a share of the stroke, and the share of the samples that may have it. A difference
within `DEVIATIONS` standard deviations does not count.
"""

CHECK_WIRE = "check the bead, the contacts, the load and the air around the wire; if all are right, identify it again"
CHECK_SENSOR = "is it the identified wire? check how the sensor is mounted, the contacts and the leads"


def tracking_caveats(log: Log) -> tuple[str, ...]:
    """Return reasons to distrust the metrics of a tracking run. DataError when the log is of another kind of run.

    The first reasons were known before the run, for example that the reference was smoothed.
    """
    return (*texts_of(log, "caveats"), *sample_caveats(log), *measured_caveats(log))


def measured_caveats(log: Log) -> tuple[str, ...]:
    """Return reasons to distrust a sensor or the wire file, found in the measurements of any run."""
    return (*_noise_caveats(log), *_resistance_caveats(log), *_contradiction_caveats(log))


def run_caveats(log: Log) -> tuple[str, ...]:
    """Return reasons to distrust the content of a log, or the metrics of its run. The run may be of any kind."""
    metrics = tracking_caveats(log) if has_setpoint(log) else (*texts_of(log, "caveats"), *measured_caveats(log))
    return (*log.caveats, *metrics, *(_command_caveats(log) if "controller" in log.metadata else ()))


def _noise_caveats(log: Log) -> tuple[str, ...]:
    if not {"rig", "wire"} <= log.metadata.keys():  # no controller assumed a noise; `identify` measures it
        return ()
    assumed_c = rig_config_of(log).feedback.noise_c
    balance = wire_of(log).heat_balance
    if balance is not None:
        assumed_c = balance.assumed_noise_c(assumed_c)
    return noise_caveats(log.column_with_gaps("temperature_c"), assumed_c)


def _resistance_caveats(log: Log) -> tuple[str, ...]:
    if "nominal_balance" not in log.metadata:
        return ()
    current_a, voltage_v = log.column_with_gaps("current_a"), log.column_with_gaps("voltage_v")
    flows = current_a >= MEASURABLE * rig_config_of(log).limits.current_max_a
    return resistance_caveats(of_finite(np.median, voltage_v[flows] / current_a[flows]), nominal_balance(log))


def _contradiction_caveats(log: Log) -> tuple[str, ...]:
    """Return a caveat if sensor and resistance contradicted each other, and the sensor remained the source."""
    share = of_finite(np.mean, log.column("resistance_wrong")) if "resistance_wrong" in log.columns else 0.0
    if not share > FEW_MISSING:
        return _difference_caveats(log)
    when = f"for {100.0 * share:.0f} % of the time the resistance of the wire contradicted the displacement sensor"
    return (f"{when}, and one of them is wrong: {CHECK_SENSOR}",)


def _difference_caveats(log: Log) -> tuple[str, ...]:
    """Return a caveat if the displacement by the resistance often differs from the displacement that the run shows.

    The run shows the displacement by the sensor, or without one the estimate, which the model alone may give.
    """
    needed = {"by_resistance_mm", "by_resistance_sd_mm", "estimated_mm"}
    if "wire" not in log.metadata or not needed <= log.columns.keys():
        return ()
    sensor_mm, stroke_mm = measured_mm(log), travel_mm(wire_of(log).model).stroke_mm
    is_measured = bool(np.isfinite(sensor_mm).any())
    shown_mm = sensor_mm if is_measured else log.column_with_gaps("estimated_mm")
    difference_mm = np.abs(log.column_with_gaps("by_resistance_mm") - shown_mm)
    noise_mm = DEVIATIONS * log.column_with_gaps("by_resistance_sd_mm")
    for difference, often in DIFFERENCES:
        differs = difference_mm > np.maximum(difference * stroke_mm, noise_mm)
        share = of_finite(np.mean, differs[np.isfinite(difference_mm)].astype(np.float64))
        if share > often:
            percent = 100.0 * float(np.median(difference_mm[differs])) / stroke_mm
            when = f"in {100.0 * share:.0f} % of the samples the displacement by the resistance differed from"
            what = f"{when} {'the sensor' if is_measured else 'the estimate'} by {percent:.0f} % of the stroke (median)"
            return (f"{what}: {CHECK_SENSOR if is_measured else CHECK_WIRE}",)
    return ()


def sample_caveats(log: Log) -> tuple[str, ...]:
    """Return the reason why the tracking error is unknown, or known only for a part of the samples, if it is so."""
    log = log.without_trips()
    error = error_percent(log)[log.column("time_s") >= scored_from_s(log)]
    if error.size == 0:
        return ("the tracking error is unknown: the run ended in its approach, which is not scored",)
    replaced, unknown = replaced_share(log), int(np.count_nonzero(np.isnan(error)))
    if replaced > MOST_REPLACED:
        return (f"the tracking error is unknown: {_replaced_text(replaced)}",)
    if unknown == error.size:
        return ("the tracking error is unknown: no displacement was measured (no working displacement sensor)",)
    if unknown <= FEW_MISSING * error.size:
        return ()
    reasons = [_replaced_text(replaced)] if replaced else []
    if missing := unknown - round(replaced * error.size):
        share = f"{100.0 * missing / error.size:.0f} %"
        reasons.append(f"{missing} of {error.size} samples of the displacement are missing ({share})")
    return (f"{', and '.join(reasons)}: the tracking error is computed from the other samples",)


def _replaced_text(share: float) -> str:
    why = "because it gave no reading, or readings that contradict the resistance"
    return f"the displacement sensor was replaced for {100.0 * share:.0f} % of the time, {why}"


def _command_caveats(log: Log) -> Iterator[str]:
    """Yield caveats about the commands of the user's controller: currents and setpoints outside their ranges."""
    current_max_a = rig_config_of(log).limits.current_max_a
    commanded_a = log.column_with_gaps("commanded_a")
    if above := int(np.count_nonzero(commanded_a > current_max_a)):
        limit = f"current_max_a = {current_max_a:g} A (largest {np.nanmax(commanded_a):.3g} A)"
        yield f"{above} of {commanded_a.size} commands were above {limit} and were clamped"
    if negative := int(np.count_nonzero(commanded_a < 0.0)):
        lowest = f"lowest {np.nanmin(commanded_a):.3g} A"
        yield f"{negative} of {commanded_a.size} commands were negative ({lowest}), and zero was sent"
    setpoint_mm, reach_mm = log.column_with_gaps("setpoint_mm"), sorted(travel_mm(wire_of(log).model))
    if outside := int(np.count_nonzero((setpoint_mm < reach_mm[0]) | (setpoint_mm > reach_mm[1]))):
        reach = f"{reach_mm[0]:.2f} to {reach_mm[1]:.2f} mm"
        yield f"{outside} of {setpoint_mm.size} setpoints were outside the reach of the wire, {reach}"
