"""The table of the metrics of runs."""

from __future__ import annotations

from math import isnan

from smadrive.runs.metrics.run import TrackingMetrics

HEADER = ("", "RMS error", "max error", "trips", "missed deadlines")


def table_row(name: str, metrics: TrackingMetrics) -> tuple[str, ...]:
    """Return the row of a run in the table of metrics. `HEADER` names the columns."""
    return (
        name,
        _percent(metrics.rms_percent),
        _percent(metrics.max_percent),
        str(metrics.trips),
        str(metrics.missed_deadlines),
    )


def _percent(value: float) -> str:
    return "unknown" if isnan(value) else f"{value:.2f} %"
