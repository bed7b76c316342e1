"""The assessment of a wire from its file, its health record and the rig: drift, verdict, expected resistance."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from smadrive.display.number_text import count_text, quantity
from smadrive.errors import DataError, SmadriveError
from smadrive.files.kinds import MODEL
from smadrive.rig.config import FeedbackConfig
from smadrive.runs.health.entries import identification_entry, key_of, widths_of
from smadrive.runs.log.reader import Log
from smadrive.runs.run_log import WIRE_FILE
from smadrive.runs.run_metadata import rig_config_of
from smadrive.wire.health.drift import SIGNIFICANT, Drift, WireHealth, gains_of, wire_health
from smadrive.wire.health.entry import Estimate, HealthEntry
from smadrive.wire.health.expected_rest import ExpectedRest, expected_rest
from smadrive.wire.health.record import read_health
from smadrive.wire.health.sensitivity import error_gains
from smadrive.wire.heat_balance import BalanceSource
from smadrive.wire.identified_wire import IdentifiedWire, load_wire

NAMES = {
    "rest_ohm": ("resistance at rest", "Ω"),
    "heating_c": ("heating branch", "°C"),
    "cooling_c": ("cooling branch", "°C"),
    "stroke_mm": ("stroke", "mm"),
}
"""Name and unit of each quantity of `QUANTITIES`."""

HEADER = ("", "identified", "last measured", "drift", "tracking error")
"""`last measured` is the value in the last run that has measured the quantity.

The last column is the tracking error that the drift causes in a run without a displacement sensor.
"""


class Assessment(NamedTuple):
    """The health of a wire, the entries of its record, and the reasons to distrust them.

    `health` is None if the wire has no record, or if the record or the model file cannot be read.
    """

    health: WireHealth | None
    entries: tuple[HealthEntry, ...] = ()
    caveats: tuple[str, ...] = ()


def assess(wire_file: Path, feedback: FeedbackConfig) -> Assessment:
    """Return the assessment of the wire in `wire_file`.

    `feedback` holds the closed-loop time and the noise of the thermocouple. If the record cannot be read, `health` is
    None and the reason is a caveat. Raises the errors of `load_wire`.
    """
    wire, now = load_wire(wire_file), identification_entry(wire_file)
    try:
        record = read_health(wire_file)
    except DataError as error:
        return Assessment(None, caveats=(str(error),))
    if not record.entries:
        return Assessment(None, caveats=record.caveats)
    balance = wire.heat_balance
    entries = record.entries if is_identified(record.entries, now) else (*record.entries, now)
    gains = error_gains(
        widths_of(wire),
        loop_share=0.0 if balance is None else feedback.closed_loop_s / balance.time_constant_s,
        noise_c=feedback.noise_c if balance is None else balance.assumed_noise_c(feedback.noise_c),
        fit_percent=now.model_percent,
    )
    each = gains_of(gains, now.rest_ohm.value, now.stroke_mm.value)
    return Assessment(wire_health(entries, each, gains.allowed_percent), entries, record.caveats)


def assessment_of(log: Log) -> Assessment | None:
    """Return the present assessment of the wire of a run; None if the file of the wire is unknown or missing.

    If the model file cannot be used, `health` is None and the reason is a caveat.
    """
    wire_file = Path(log.metadata.get(WIRE_FILE, ""))
    if not os.path.isfile(wire_file):
        return None
    try:
        return assess(wire_file, rig_config_of(log).feedback)
    except SmadriveError as error:
        return Assessment(None, caveats=(str(error),))


def is_identified(entries: tuple[HealthEntry, ...], now: HealthEntry) -> bool:
    """Return True if `now`, the entry of the model file, is the last identification in `entries`."""
    identified = [entry.model for entry in entries if entry.is_identification]
    return identified[-1:] == [now.model]


def expected_of(identified: IdentifiedWire) -> ExpectedRest | None:
    """Return the resistance at rest that the next run of the wire is expected to find.

    None if the resistance is not identified. A record that cannot be read counts as an empty one.
    """
    balance, wire_file = identified.heat_balance, wire_file_of(identified)
    if balance is None or balance.source is not BalanceSource.IDENTIFIED:
        return None
    try:
        entries = () if wire_file is None else read_health(wire_file).entries
    except DataError:
        entries = ()
    return expected_rest(entries, key_of(identified.model), balance.resistance_cold_ohm)


def wire_file_of(identified: IdentifiedWire) -> Path | None:
    """Return the absolute path of the file from which the wire was loaded; None for a wire from elsewhere."""
    path = Path(identified.source).absolute()
    return path if identified.source and MODEL.has_ending(path) and os.path.isfile(path) else None


def health_rows(health: WireHealth) -> Iterator[tuple[str, ...]]:
    """Yield a row of texts for each drift, with the columns of `HEADER`."""
    for name, drift in health.drifts.items():
        title, unit = NAMES[name]
        yield (
            title,
            quantity(drift.before.value, 2, unit),
            quantity(drift.now.value, 2, unit),
            f"{round(drift.change.value, 2) + 0.0:+.2f} ± {drift.change.error:.2f} {unit.replace('°C', 'K')}",
            _error_text(drift),
        )


def _error_text(drift: Drift) -> str:
    """Return the tracking error of a drift that counts, otherwise the reason why the drift does not count."""
    if drift.counts:
        return f"{drift.error_percent:.2g} %"
    return "one run only" if drift.is_significant else "may be chance"


def health_lines(health: WireHealth) -> Iterator[str]:
    """Yield the sentences about the health of a wire: verdict, runs, drift per 100 cycles, and moves of the models."""
    yield str(health)
    runs = count_text(health.runs, "run")
    cycles = f"{health.cycles:.4g} {'cycle' if health.cycles == 1.0 else 'cycles'}"
    yield f"{runs} and {cycles} since the identification, {health.all_cycles:.4g} in all"
    for name, drift in health.drifts.items():
        if drift.counts and abs(drift.per_cycle.value) > SIGNIFICANT * drift.per_cycle.error:
            title, unit = NAMES[name]
            yield f"{title}: {100.0 * drift.per_cycle.value:+.2g} {unit.replace('°C', 'K')} per 100 cycles"
    for name, moved in (("model", health.model_moved), ("adapted model", health.adapted_moved)):
        if moved is not None and any(moved):
            shifts = f"heating {moved.heating_k:+.2f} K, cooling {moved.cooling_k:+.2f} K"
            yield f"{name} since the first identification: {shifts}, stroke {moved.stroke_percent:+.1f} %"


def health_values(assessment: Assessment) -> dict[str, Any] | None:
    """Return the health of a wire as values for JSON; None without a record."""
    health = assessment.health
    if health is None:
        return None
    return {
        **health._asdict(),
        "drifts": {name: _drift_values(drift) for name, drift in health.drifts.items()},
        "sentence": str(health),
        "model_moved": health.model_moved._asdict(),
        "adapted_moved": None if health.adapted_moved is None else health.adapted_moved._asdict(),
        "caveats": list(assessment.caveats),
    }


def _drift_values(drift: Drift) -> dict[str, Any]:
    return {name: value._asdict() if isinstance(value, Estimate) else value for name, value in drift._asdict().items()}
