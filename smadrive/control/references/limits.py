"""Limits of a reference: its displacement, its duration and its number of samples."""

from __future__ import annotations

from math import isfinite

from smadrive.errors import ConfigError, DataError
from smadrive.numerics.arrays import FloatArray

WHERE = "reference"
"""The part `where` of the errors about references."""

TABLE_STEP_S = 0.02
"""Approximate step of the tables of curved shapes, in s. A reference joins the rows of its table by straight lines.

At loop rates up to 50 Hz the step is at most one period.
"""

LONGEST_S = 86_400.0
"""The longest reference: a day. At 20 Hz its feasibility check takes about three minutes and 1.3 GB of memory."""

SHORTEST_S = 0.1
"""The shortest reference, and the shortest half swing, s. Every wire is slower."""

FARTHEST_MM = 1e5
"""The largest displacement of a reference, mm: the length of the longest wire that a wire file may describe."""

LONGEST_REPEATED_S = 604_800.0
"""The longest repeated reference: a week. At 20 Hz its log has about 1.6 GB."""


def check_displacement(name: str, value_mm: float) -> None:
    """Raise DataError when `value_mm` is NaN, or when its absolute value exceeds `FARTHEST_MM`.

    `name` is the name of the displacement in the error.
    """
    if not abs(value_mm) <= FARTHEST_MM:
        raise DataError(
            "farther than any wire moves",
            where=f"{WHERE}: {name}",
            value=f"{value_mm:g} mm",
            limit=f"±{FARTHEST_MM:g} mm",
            cure="is the displacement in millimetres?",
        )


def check_length(duration_s: float, pieces: float = 0.0, longest_s: float = LONGEST_S) -> None:
    """Raise DataError for a reference that is too short or too long, or that has too many samples.

    The shortest duration is `SHORTEST_S`, the longest is `longest_s`. `pieces` is the number of straight lines of the
    reference. Call this function before the table is made, because a table that is too large may exhaust the memory.
    """
    value = f"{duration_s:g} s"
    if duration_s < SHORTEST_S:
        cure = "slow it down; is its time in seconds?"
        raise DataError("too short", where=WHERE, value=value, limit=f"{SHORTEST_S:g} s", cure=cure)
    if duration_s > longest_s:
        cure = "shorten it, or lower its number of cycles; is its time in seconds?"
        raise DataError("too long", where=WHERE, value=value, limit=f"{longest_s:g} s", cure=cure)
    most = longest_s / TABLE_STEP_S
    if pieces > most:
        raise DataError("too many samples", where=WHERE, value=pieces, limit=most, cure="lower the number of samples")


def check_end(duration_s: float) -> None:
    """Raise ConfigError for a reference that lasts for ever."""
    if not isfinite(duration_s):
        raise ConfigError("has no end", where=WHERE, cure="give it a number of cycles")


def check_rig_limits(scored_mm: FloatArray, low_mm: float | None, high_mm: float | None) -> None:
    """Raise ConfigError when the displacements of a reference, mm, exceed a limit of the rig: the run would trip.

    `low_mm` is displacement_min_mm and `high_mm` is displacement_max_mm of the rig file; None is no limit.
    """
    lowest_mm, highest_mm = float(scored_mm.min()), float(scored_mm.max())
    if low_mm is not None and lowest_mm < low_mm:
        raise _beyond_limit("lowest", lowest_mm, f"displacement_min_mm = {low_mm:g} mm")
    if high_mm is not None and highest_mm > high_mm:
        raise _beyond_limit("highest", highest_mm, f"displacement_max_mm = {high_mm:g} mm")


def _beyond_limit(name: str, value_mm: float, limit: str) -> ConfigError:
    return ConfigError(
        "outside the displacement limits of the rig",
        where=f"{WHERE}: {name} value",
        value=f"{round(value_mm, 3):g} mm",
        limit=limit,
        cure="keep the reference within these limits, or change the limit under [limits] if the mechanics allow it",
    )
