"""One entry of a health record: the wire as one identification or one run has found it."""

from __future__ import annotations

from math import isfinite, nan
from typing import Annotated, Any, NamedTuple

from pydantic import BaseModel, BeforeValidator, ConfigDict

IDENTIFICATION = "identification"
"""The `kind` of an entry that holds the wire file itself. Every other kind is that of a run."""


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
    """The places of the branches in °C, where they pass the middle of the stroke, and the stroke in mm."""

    heating_c: Number
    cooling_c: Number
    stroke_mm: Number


class HealthEntry(BaseModel):
    """The wire as one identification or one run has found it.

    kind             `identification`, or the kind of the run as in its log
    begun            start of the run, or time of the identification (ISO 8601, UTC)
    model            key of the model of the wire file; another key means another identification
    cycles           cycles of the wire during the run
    log              name of the log, without its folder
    tripped          True if a trip ended the run
    rest_ohm         resistance at rest: of the cold wire, with leads and contacts
    rest_spread      largest deviation of the resistance from the model during the run, as a share
    rest_c           mean temperature of the wire at which rest_ohm was measured, °C
    reference_c      temperature to which rest_ohm is corrected, °C; unknown without a temperature coefficient
    stroke_mm        stroke of the wire
    heating_c        place of the heating branch
    cooling_c        place of the cooling branch
    model_percent    RMS error of the model of the wire file in this run, or of its fit, in % of the stroke
    rms_percent      RMS of the tracking error, in % of the stroke
    max_percent      largest tracking error, in % of the stroke
    adapted          loop of the adapted model at the end of the run; None without online adaptation
    """

    model_config = ConfigDict(extra="ignore", frozen=True, protected_namespaces=())

    kind: str
    begun: str
    model: str
    cycles: float = 0.0
    log: str = ""
    tripped: bool = False
    rest_ohm: Estimate = Estimate()
    rest_spread: Number = nan
    rest_c: Number = nan
    reference_c: Number = nan
    stroke_mm: Estimate = Estimate()
    heating_c: Estimate = Estimate()
    cooling_c: Estimate = Estimate()
    model_percent: Number = nan
    rms_percent: Number = nan
    max_percent: Number = nan
    adapted: LoopShape | None = None

    @property
    def is_identification(self) -> bool:
        """True for the entry of a wire file, False for the entry of a run."""
        return self.kind == IDENTIFICATION
