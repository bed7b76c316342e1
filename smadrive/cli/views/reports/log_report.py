"""The report of one log: its end, metrics, plots, events, and the configuration of the run."""

from __future__ import annotations

import json
from collections.abc import Iterator
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np

from smadrive.display.number_text import quantity
from smadrive.measurement import DisplacementFrom
from smadrive.runs.comparison.settings import set_values
from smadrive.runs.cycling.cycle_table import CYCLE_HEADER, cycle_rows, thinned
from smadrive.runs.cycling.cycles import cycles_of, cycling_of
from smadrive.runs.figures.cycle_plots import cycle_plot
from smadrive.runs.figures.health_plot import health_plot
from smadrive.runs.figures.log_plots import log_plots
from smadrive.runs.figures.session_plots import change_table
from smadrive.runs.health.assessment import HEADER, assessment_of, health_lines, health_rows
from smadrive.runs.log.reader import STOP, Log
from smadrive.runs.metrics.caveats import run_caveats
from smadrive.runs.metrics.run import RunMetrics, is_virtual, run_metrics
from smadrive.runs.report import Banner, Grid, Listing, Notes, PagePart, Tiles, write_report
from smadrive.runs.run_kind import RunKind
from smadrive.runs.run_metadata import rig_config_of
from smadrive.runs.session_record import models_of, plain_events, session_ended_event, trips_of
from smadrive.safety.shutdown import UNCONFIRMED

TITLES = {
    RunKind.EXCITATION: "identification experiment",
    RunKind.TRACKING: "tracking run",
    RunKind.STEP: "manual step",
    RunKind.OBSERVATION: "observation without heat",
    RunKind.OWN_CONTROLLER: "run of an own controller",
    RunKind.SERVO: "motions of a servo",
    RunKind.SESSION: "tuning session",
}

GAP = 1.5
"""The longest time without a measurement is shown if it exceeds this number of periods."""

MOST_CYCLES = 50
"""Largest number of cycles in the table of the page."""

NAMED = ("displacement_from", "inverse", "controller", "seed", "title")
"""The metadata that the provenance shows, if the log has them."""


def write_log_report(path: Path, log: Log) -> RunMetrics:
    """Write the page of `log` to `path`, and return the metrics of the run.

    DataError when the log lacks content, or when the page cannot be written.
    """
    config, summary = rig_config_of(log), run_metrics(log)
    devices = ", ".join(f"{name}: {identity}" for name, identity in log.parsed("devices", _items))
    parts: list[PagePart] = [
        state_of(log, summary),
        *_caveats(log),
        Tiles([*_tiles(summary, config.limits.current_max_a, is_virtual=is_virtual(log)), *_gap(log, config.rate_hz)]),
        *_cycles(log),
        *log_plots(log),
        *_health(log),
        *([change_table(log)] if log.kind is RunKind.SESSION else []),
        *_events(log),
    ]
    parts += [_provenance(log), *_background(log)]
    lead = f"{clock_text(log.start_time)} · wire {config.wire} · {devices}"
    write_report(path, f"{config.name}: {TITLES[log.kind]}", lead, parts)
    return summary


def state_of(log: Log, summary: RunMetrics) -> Banner:
    """Return the banner, a coloured line of the page, that says how the run ended."""
    if not log.end_time:
        return Banner(
            "warning",
            f"This log has no end: its writer was killed, or still writes. The log holds {summary.duration_s:.1f} s; "
            "at most the last second is missing.",
        )
    if log.kind is RunKind.SESSION and _is_ended_safely(log) and (trips := trips_of(log)):
        last, count = trips[-1], f", the last of {len(trips)} trips" if len(trips) > 1 else ""
        end = f"The session ended after {summary.duration_s:.1f} s with the heater off, confirmed"
        return Banner("bad", f"Tripped at {last.time_s:.1f} s{count}: {last.message} — {end}.")
    is_stopped = log.ended_by.startswith(STOP)
    if not log.ended_by or (log.kind is RunKind.SESSION and _is_ended_safely(log) and not is_stopped):
        return Banner("good", f"Complete: {summary.duration_s:.1f} s, ended at zero current.")
    unconfirmed = [event.message for event in log.events if event.message.startswith(UNCONFIRMED)]
    return Banner(
        "warning" if log.is_ended_by_user and not unconfirmed else "bad",
        " — ".join([f"Ended after {summary.duration_s:.1f} s by {log.ended_by}", *unconfirmed]),
    )


def _is_ended_safely(log: Log) -> bool:
    """Return True if the user ended the tuning session and the heater is confirmed off."""
    messages = [event.message for event in log.events]
    return log.is_ended_by_user and session_ended_event(confirmed=True) in messages


def _caveats(log: Log) -> Iterator[Banner]:
    """Yield the reasons to distrust the content or the metrics, as `run` prints them on the terminal."""
    for caveat in run_caveats(log):
        yield Banner("warning", f"Warning: {caveat}.")


def _tiles(summary: RunMetrics, limit_a: float, *, is_virtual: bool) -> Iterator[tuple[str, str]]:
    if isfinite(summary.rms_percent):
        yield f"{summary.rms_percent:.2f} %", "RMS error, of the stroke"
        yield f"{summary.max_percent:.2f} %", "largest error"
    yield quantity(summary.temperature_max_c, 1, "°C"), "hottest reading"
    yield quantity(summary.current_max_a, 3, "A"), f"largest measured current, limit {limit_a:g} A"
    yield quantity(summary.energy_j, 0, "J"), "electrical energy"
    rarely = 0.0 < summary.limited_percent < 0.1
    yield "< 0.1 %" if rarely else f"{summary.limited_percent:.1f} %", "of the time at a limit"
    yield f"{summary.ticks}", "ticks"
    worst = "none in virtual time" if is_virtual else f"worst {1e3 * summary.late_max_s:.1f} ms"
    yield f"{summary.missed_deadlines}", f"missed deadlines, {worst}"


def _gap(log: Log, rate_hz: float) -> Iterator[tuple[str, str]]:
    """Yield the longest time between two measurements if it exceeds `GAP` periods.

    The log has no row for a lost exchange, so the lateness of the rows does not show it.
    """
    gap_s = float(np.diff(log.column("time_s")).max(initial=0.0))
    if gap_s > GAP / rate_hz:
        yield f"{1e3 * gap_s:.0f} ms", f"longest time without a measurement, period {1e3 / rate_hz:g} ms"


def _cycles(log: Log) -> Iterator[PagePart]:
    """Yield the plot over the cycles and their table, for a run that repeats its reference."""
    cycles, cycling = cycles_of(log), cycling_of(log)
    if not cycles or cycling is None:
        return
    yield cycle_plot(cycles, len(cycling.before))
    rows, verb = cycle_rows(thinned(cycles, MOST_CYCLES)), "cycle is" if cycling.total == 1 else "cycles are"
    count = f"{len(cycles)} of {cycling.total} {verb} complete"
    yield Grid(CYCLE_HEADER, rows)
    part = f"; the first {len(cycling.before)} are those of {cycling.continues}" if cycling.before else ""
    thin = f"; the table shows {len(rows)} of them" if len(rows) < len(cycles) else ""
    yield Notes([f"{count}{part}{thin}."])


def _health(log: Log) -> Iterator[PagePart]:
    """Yield the health of the wire, if its model file and the health record beside that file exist."""
    found = assessment_of(log)
    if found is None:
        return
    for caveat in found.caveats:
        yield Banner("warning", f"Warning: {caveat}.")
    if found.health is not None:
        yield health_plot(found.entries)
        yield Grid(HEADER, list(health_rows(found.health)))
        yield Notes([f"{line[0].upper()}{line[1:]}." for line in health_lines(found.health)])


def _events(log: Log) -> Iterator[Grid]:
    """Yield the table of events. The text of a fault includes its remedy."""
    rows = [(f"{event.time_s:.2f} s", event.message) for event in plain_events(log)]
    yield Grid(("time", "event"), rows or [("", "none: no fault, no limit, no warning")], "Events", texts=True)


def _provenance(log: Log) -> Grid:
    versions = ", ".join(f"{name} {number}" for name, number in log.parsed("versions", _items))
    rows = [
        ("log", str(log.path)),
        ("begun", clock_text(log.start_time)),
        ("ended", clock_text(log.end_time) or "not ended"),
        *((f"device {name}", identity) for name, identity in log.parsed("devices", _items)),
        *((f"address of {device.name}", device.url) for device in rig_config_of(log).devices),
        ("versions", versions),
        ("machine", log.text("machine")),
        *((name.replace("_", " "), _named(log, name)) for name in NAMED if name in log.metadata),
    ]
    return Grid(("", ""), rows, "Provenance", texts=True)


def _named(log: Log, name: str) -> str:
    """Return the text of the metadata `name`. A source that gave no displacement is marked."""
    text = log.text(name)
    is_missing = name == "displacement_from" and text == DisplacementFrom.SENSOR and not _has_displacement(log)
    return f"{text} (it measured nothing)" if is_missing else text


def _has_displacement(log: Log) -> bool:
    return bool(np.isfinite(log.column_with_gaps("displacement_mm")).any())


def _background(log: Log) -> Iterator[PagePart]:
    """Yield the configuration of the run. The reader opens each part by a click on its title."""
    yield Grid(("key", "value"), list(set_values(log.json("rig"))), "Rig file", texts=True, folded=True)
    if "wire" in log.metadata:
        yield Listing("Wire: the model of the run", log.text("wire"))
    for number, text in models_of(log).items():
        yield Listing(f"Model {number}", json.dumps(json.loads(text), indent=1))
    if "step" in log.metadata:
        yield Grid(("key", "value"), list(set_values(log.json("step"))), "Step", texts=True, folded=True)
    if "excitation" in log.metadata:
        yield Grid(("key", "value"), list(set_values(log.json("excitation"))), "Excitation", texts=True, folded=True)
    yield Grid(("key", "value"), list(set_values(log.json("nominal_balance"))), "Nominal heat balance", True, True)
    yield Listing("Device profiles", json.dumps(log.json("profiles"), indent=1))


def _items(values: dict[str, Any]) -> list[tuple[str, str]]:
    return [(name, str(value)) for name, value in values.items()]


def clock_text(time: str) -> str:
    """Return a time of a log (ISO 8601) in a readable form, such as `2026-11-23 12:00:00 UTC`; "" stays ""."""
    return time.replace("T", " ").replace("+00:00", " UTC")
