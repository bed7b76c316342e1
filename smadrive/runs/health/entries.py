"""Makes the entries of a health record: from a model file, and from the log of a run."""

from __future__ import annotations

import hashlib
import json
from math import nan
from pathlib import Path

import numpy as np

from smadrive.hysteresis import IdentifiedModel
from smadrive.hysteresis.model_file import model_text, parse_model, read_model
from smadrive.hysteresis.reversal import turning_points
from smadrive.identification.adaptation.adaptation import ADAPTED
from smadrive.identification.loop_drift import UNKNOWN, LoopDrift, fit_loop_drift, wire_temperature_c
from smadrive.identification.reshape import shape_of
from smadrive.identification.thermal_fit.fit import SYSTEMATIC
from smadrive.numerics.arrays import FloatArray
from smadrive.rig.config import RigConfig
from smadrive.runs.health.rest_resistance import HeatedSamples, RestResistance, rest_resistance
from smadrive.runs.log.reader import Log
from smadrive.runs.metrics.caveats import FEW_MISSING
from smadrive.runs.metrics.tracking_error import has_setpoint, measured_mm, replaced_share, tracking_percent
from smadrive.runs.run_metadata import (
    displacement_in_time,
    measures_resistance,
    nominal_balance,
    rig_config_of,
    wire_of,
)
from smadrive.runs.session_record import models_of, tunings_of
from smadrive.safety.resistance_band import current_min_a
from smadrive.wire.health.entry import IDENTIFICATION, Estimate, HealthEntry, LoopShape
from smadrive.wire.health.sensitivity import LoopWidths
from smadrive.wire.identified_wire import IdentifiedWire, load_wire
from smadrive.wire.wire_model import WireModel, travel_mm

CYCLE = 0.1
"""A movement in one direction by more than this share of the stroke is half a cycle."""

POINTS = 2000
"""Number of points of a branch in the search for its middle."""

MOST_ROWS = 20_000
"""Of a run with more rows, the loop is fitted to the last `MOST_ROWS`, which show the present state of the wire."""


def key_of(model: IdentifiedModel) -> str:
    """Return the key of a model: equal models have the same key, in every version of the file format."""
    document = json.loads(model_text(model, {}, place="wire"))
    del document["schema"], document["provenance"]
    return hashlib.sha256(json.dumps(document, sort_keys=True).encode()).hexdigest()[:12]


def identification_entry(wire_file: Path) -> HealthEntry:
    """Return the entry of the wire in `wire_file`. Raises the errors of `load_wire`."""
    wire = load_wire(wire_file)
    provenance = json.loads(read_model(wire_file)).get("provenance", {})
    loop, balance = loop_shape(wire.model), wire.heat_balance
    cold_ohm = nan if balance is None else balance.resistance_cold_ohm
    percent = provenance.get("rms_percent")
    return HealthEntry(
        kind=IDENTIFICATION,
        begun=str(provenance.get("identified", "")),
        model=key_of(wire.model),
        rest_ohm=Estimate(cold_ohm, SYSTEMATIC * cold_ohm),
        heating_c=Estimate(loop.heating_c),
        cooling_c=Estimate(loop.cooling_c),
        stroke_mm=Estimate(loop.stroke_mm),
        model_percent=float(percent) if isinstance(percent, int | float) else nan,
    )


def run_entry(log: Log, wire_file: Path) -> HealthEntry:
    """Return the entry of the run in `log`, on the wire in `wire_file`.

    A run whose log holds a model is compared with this model, an excitation with the model in the model file. A
    measurement that tripped does not count: it may be invalid.
    """
    log = log.without_trips()
    config = rig_config_of(log)
    wire = wire_of(log) if "wire" in log.metadata else load_wire(wire_file)
    stepped = WireModel(wire.model, wire.heat_balance or nominal_balance(log))
    drift = _drift(log, stepped, config)
    is_measured = bool(np.isfinite(measured_mm(log)).any())
    moved_mm = measured_mm(log) if is_measured else log.column_with_gaps("estimated_mm")
    rest = _at_rest(log, stepped, config, moved_mm) if measures_resistance(log) else RestResistance()
    rms, largest = _tracking_percent(log)
    loop = loop_shape(wire.model)
    return HealthEntry(
        kind=log.kind.value,
        begun=log.start_time,
        model=key_of(wire.model),
        cycles=cycles_of_path(_moved_mm(log), loop.stroke_mm),
        log=log.path.name,
        tripped=log.is_tripped,
        rest_ohm=rest.ohm if is_measured else Estimate(),
        estimated_rest_ohm=Estimate() if is_measured else rest.ohm,
        rest_spread=rest.spread,
        rest_c=rest.at_c,
        model_percent=drift.model_percent,
        rms_percent=rms,
        max_percent=largest,
        adapted=_adapted(log),
        heating_c=Estimate(loop.heating_c + drift.heating_k, drift.errors[0]),
        cooling_c=Estimate(loop.cooling_c + drift.cooling_k, drift.errors[1]),
        stroke_mm=Estimate(loop.stroke_mm * (1.0 + drift.stroke_share), loop.stroke_mm * drift.errors[2]),
    )


def loop_shape(model: IdentifiedModel, identified: IdentifiedModel | None = None) -> LoopShape:
    """Return the stroke of `model`, and the temperatures at which its branches pass the middle of the travel.

    With `identified`, the middle is taken from the travel of `identified`. Use this for an adapted model: few runs
    visit the ends of the branches, so the ends of an adapted model are uncertain.
    """
    v, middle_mm = np.linspace(*model.input_range, POINTS), travel_mm(identified or model).at_mm(0.5)
    middle = (middle_mm - model.offset) / model.scale
    heating_c, cooling_c = (float(np.interp(middle, model.branch(v, rising=rising), v)) for rising in (True, False))
    return LoopShape(heating_c, cooling_c, travel_mm(model).stroke_mm)


def cycles_of_path(moved_mm: FloatArray, stroke_mm: float) -> float:
    """Return the number of cycles along a path: half the number of movements by more than `CYCLE` of the stroke."""
    path_mm = moved_mm[np.isfinite(moved_mm)]
    if len(path_mm) < 2:
        return 0.0
    corners = path_mm[turning_points(path_mm, 0.5 * CYCLE * stroke_mm)]
    return 0.5 * float(np.count_nonzero(np.abs(np.diff(corners)) > CYCLE * stroke_mm))


def widths_of(wire: IdentifiedWire) -> LoopWidths:
    """Return the widths of the branches, and the height of the loop's middle above the ambient temperature.

    The height is 0 without an identified heat balance.
    """
    shape, balance = shape_of(wire.model), wire.heat_balance
    middle_c = 0.5 * (shape.mu_heating + shape.mu_cooling)
    middle_k = 0.0 if balance is None else middle_c - balance.ambient_c
    return LoopWidths(shape.sigma_heating, shape.sigma_cooling, middle_k)


def _moved_mm(log: Log) -> FloatArray:
    """Return the estimated displacement, which has no spikes, and where there is no estimate the measured one."""
    estimated_mm = log.column_with_gaps("estimated_mm")
    return np.where(np.isfinite(estimated_mm), estimated_mm, measured_mm(log))


def _drift(log: Log, wire: WireModel, config: RigConfig) -> LoopDrift:
    """Return the drift of the loop; unknown if the sensor was replaced, as the remaining samples fit the old model."""
    if replaced_share(log) > FEW_MISSING:
        return UNKNOWN
    moved_mm = np.where(np.isfinite(measured_mm(log)), displacement_in_time(log), nan)
    columns = log.column("time_s"), log.column_with_gaps("temperature_c"), moved_mm
    rows = np.column_stack([column[-MOST_ROWS:] for column in columns])
    time_s, reading_c, displacement_mm = rows[np.isfinite(rows).all(axis=1)].T
    if len(time_s) < 2:
        return UNKNOWN
    wire_c = wire_temperature_c(time_s, reading_c, wire.balance.thermocouple_lag_s)
    return fit_loop_drift(wire.model, wire_c, displacement_mm, wire.balance.assumed_noise_c(config.feedback.noise_c))


def _at_rest(log: Log, wire: WireModel, config: RigConfig, moved_mm: FloatArray) -> RestResistance:
    names = ("time_s", "current_a", "voltage_v", "temperature_c")
    time_s, current_a, voltage_v, temperature_c = (log.column_with_gaps(name) for name in names)
    is_heated = np.isfinite(voltage_v) & np.isfinite(moved_mm)
    is_heated &= current_a >= current_min_a(config.limits.current_max_a)
    columns = (time_s, current_a, voltage_v, moved_mm, temperature_c)
    return rest_resistance(wire, HeatedSamples(*(column[is_heated] for column in columns)))


def _tracking_percent(log: Log) -> tuple[float, float]:
    """Return RMS and largest tracking error in % of the stroke; NaN if no sample has setpoint and displacement.

    Both are NaN for a tuning session: its references and tunings change, so its error says nothing about the wire.
    """
    return tracking_percent(log) if has_setpoint(log) else (nan, nan)


def _adapted(log: Log) -> LoopShape | None:
    """Return the loop of the adapted model that is in force at the end of a tuning session, or None."""
    tunings, models = tunings_of(log), models_of(log)
    if not tunings or tunings[-1].change != ADAPTED or tunings[-1].model not in models:
        return None
    model = parse_model(models[tunings[-1].model], place=f"{log.path}: adapted model")
    return loop_shape(model, wire_of(log).model)
