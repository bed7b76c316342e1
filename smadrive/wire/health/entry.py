"""One entry of a health record: the properties of the wire that one identification or one run has measured."""

from __future__ import annotations

from math import isfinite, nan
from typing import Annotated, Any, NamedTuple

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field

IDENTIFICATION = "identification"
"""The `kind` of an entry that describes an identification. Every other kind is the kind of a run."""


def _nan_for_null(value: Any) -> Any:
    return nan if value is None else value


Number = Annotated[float, BeforeValidator(_nan_for_null)]
"""A number that may be unknown: NaN here, null in the file."""


class Estimate(NamedTuple):
    """A value and its standard error, in the same unit. Unknown numbers are NaN."""

    value: Number = nan
    error: Number = nan

    @property
    def is_known(self) -> bool:
        """True if the value is known."""
        return isfinite(self.value)


class LoopShape(NamedTuple):
    """The places of the branches, °C, and the stroke, mm. A branch passes the middle of the stroke at its place."""

    heating_c: Number
    cooling_c: Number
    stroke_mm: Number


class HealthEntry(BaseModel):
    """The properties of the wire that one identification or one run has measured.

    kind                `identification`, or the kind of the run as in its log
    begun               start of the run, or time of the identification (ISO 8601, UTC)
    model               key of the model in the model file; another key means another identification
    cycles              cycles of the wire during the run
    log                 name of the log, without its folder
    tripped             True if a trip ended the run
    rest_ohm            resistance at rest: of the cold wire, with leads and contacts, Ω
    estimated_rest_ohm  resistance at rest by the estimated displacement, if none was measured, Ω; shows no drift
    rest_spread         largest deviation of the resistance from the model during the run, as a share
    rest_c              mean temperature of the wire during this measurement, °C
    stroke_mm           stroke of the wire, mm
    heating_c           place of the heating branch: its temperature at the middle of the stroke, °C
    cooling_c           place of the cooling branch, °C
    model_percent       RMS error of this model in this run, or of its fit, in % of the stroke
    rms_percent         RMS of the tracking error, in % of the stroke; NaN for a tuning session
    max_percent         largest tracking error, in % of the stroke
    adapted             loop of the adapted model at the end of the run; None without online adaptation
    """

    model_config = ConfigDict(extra="ignore", frozen=True, protected_namespaces=())

    kind: str
    begun: str
    model: str
    cycles: Annotated[float, Field(ge=0.0, allow_inf_nan=False)] = 0.0
    log: str = ""
    tripped: bool = False
    rest_ohm: Estimate = Estimate()
    estimated_rest_ohm: Estimate = Estimate()
    rest_spread: Number = nan
    rest_c: Number = nan
    stroke_mm: Estimate = Estimate()
    heating_c: Estimate = Estimate()
    cooling_c: Estimate = Estimate()
    model_percent: Number = nan
    rms_percent: Number = nan
    max_percent: Number = nan
    adapted: LoopShape | None = None

    @property
    def is_identification(self) -> bool:
        """True for the entry of an identification, False for the entry of a run."""
        return self.kind == IDENTIFICATION
