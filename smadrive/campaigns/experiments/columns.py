"""The columns of the table of results, besides the axes: unit and meaning of each metric.

The columns of a part are NaN in a run without this part. For example, a fit has no tracking.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal, NamedTuple

from smadrive.campaigns.plan.config import Experiment

Value = int | float | str | bool
Row = Mapping[str, Value]
"""The values of one run by column."""


class ResultColumn(NamedTuple):
    """Unit, meaning and type of a column. `kind` is float, bool or str."""

    unit: str
    what: str
    kind: type = float


STATE = {
    "status": ResultColumn("1", "done, tripped or failed", str),
    "error_type": ResultColumn("1", "class of the error that ended the run, or empty", str),
    "error": ResultColumn("1", "text of this error, or empty", str),
}
WIRE = {
    "wire_kind": ResultColumn("1", "kind of hysteresis of the simulated wire", str),
    "stroke_mm": ResultColumn("mm", "true stroke of the simulated wire"),
    "heat_capacity_j_per_k": ResultColumn("J/K", "true heat capacity"),
    "loss_w_per_k": ResultColumn("W/K", "true heat loss"),
    "latent_heat_j_per_kg": ResultColumn("J/kg", "true latent heat"),
    "resistance_cold_ohm": ResultColumn("ohm", "true resistance of the cold wire"),
    "thermocouple_lag_s": ResultColumn("s", "true lag of the thermocouple"),
    "mu_heating_c": ResultColumn("degC", "true centre of the heating branch"),
    "mu_cooling_c": ResultColumn("degC", "true centre of the cooling branch"),
    "sigma_heating_c": ResultColumn("K", "true width of the heating branch"),
    "sigma_cooling_c": ResultColumn("K", "true width of the cooling branch"),
}
FIT = {
    "fit_rms_percent": ResultColumn("%", "RMS error of the fit, of the span of the record"),
    "fit_max_percent": ResultColumn("%", "largest error of the fit, of the span of the record"),
    "certified": ResultColumn("1", "the identified model has its certificate", bool),
    "excitation_s": ResultColumn("s", "duration of the excitation; NaN for the fit of a record"),
    "identified_stroke_mm": ResultColumn("mm", "identified stroke"),
    "identified_heat_capacity_j_per_k": ResultColumn("J/K", "identified heat capacity"),
    "identified_loss_w_per_k": ResultColumn("W/K", "identified heat loss"),
    "identified_latent_heat_j": ResultColumn("J", "identified latent heat"),
    "identified_resistance_cold_ohm": ResultColumn("ohm", "identified resistance of the cold wire"),
}
TRACKING = {
    "rms_percent": ResultColumn("%", "RMS of setpoint minus true displacement after the approach, of the true stroke"),
    "max_percent": ResultColumn("%", "largest magnitude of this error, of the true stroke"),
    "smoothed": ResultColumn("1", "the wire could not follow the requested reference", bool),
    "ticks": ResultColumn("1", "number of ticks of the tracking run"),
    "missed_deadlines": ResultColumn("1", "ticks that missed their deadline in virtual time"),
    "energy_j": ResultColumn("J", "electrical energy of the tracking run"),
    "temperature_max_c": ResultColumn("degC", "highest true temperature of the tracking run"),
    "current_max_a": ResultColumn("A", "largest measured current of the tracking run"),
    "limited_percent": ResultColumn("%", "share of the ticks in which a limit reduced the output"),
}
COLUMNS = STATE | WIRE | FIT | TRACKING
"""Every column, in the order of the table."""


def labelled(name: str) -> str:
    """Return the name of a column with its unit, for a heading or an axis of a plot."""
    return name if COLUMNS[name].unit == "1" else f"{name} / {COLUMNS[name].unit}"


def columns_of(experiment: Experiment, *, has_model: bool) -> Mapping[str, ResultColumn]:
    """Return the columns that runs of an experiment can have. With a model, they fit nothing."""
    if experiment == "fit":
        return STATE | FIT
    fit = {} if has_model else FIT
    return STATE | WIRE | fit | (TRACKING if experiment == "track" else {})


def outcome_row(
    status: Literal["done", "tripped", "failed"], error: BaseException | None = None, text: str | None = None
) -> Row:
    """Return the columns `STATE` of a run that `error` ended, if any. `text` replaces the message of the error."""
    if error is None:
        return {"status": status, "error_type": "", "error": ""}
    return {"status": status, "error_type": type(error).__name__, "error": str(error) if text is None else text}
