"""The drift of a wire since its identification, and the time to identify it again.

A quantity q (resistance at rest, stroke, place of a branch) has the drift d = q_run - q_identified, with the standard
error s of both. The drift counts if |d| > `SIGNIFICANT` s in each of the last `LAST_RUNS` runs that measured q, always
in the same direction. The drifts that count cause the tracking error e = √Σ (g d)²; g is the sensitivity of a quantity.
The wire is to be identified again when e exceeds the error that an identification leaves (sensitivity.py).

A resistance at rest that has jumped is no drift: in the last run it lies outside the tolerance that fault 20 checks
(expected_rest.py). A single run shows a jump, because no sound wire changes by so much.

A drift grows about linearly with the cycles n. So an error e after n cycles reaches the allowed error after
n (e_allowed / e - 1) more cycles.
"""

from __future__ import annotations

from collections.abc import Sequence
from enum import StrEnum
from math import hypot, isfinite, nan, sqrt
from typing import NamedTuple

import numpy as np

from smadrive.wire.health.entry import Estimate, HealthEntry, LoopShape
from smadrive.wire.health.expected_rest import expected_rest
from smadrive.wire.health.sensitivity import ErrorGains

SIGNIFICANT = 3.0
"""A drift of at most this many standard errors does not count: it may be chance."""

LAST_RUNS = 2
"""The number of runs in a row that must show a drift. A draft in a single run is no drift."""

LOOP = ("heating_c", "cooling_c", "stroke_mm")
QUANTITIES = ("rest_ohm", *LOOP)
"""The fields of an entry that drift."""


class HealthVerdict(StrEnum):
    """The verdict of the record about the wire."""

    UNKNOWN = "not known yet"
    JUMPED = "resistance jumped"
    UNCHANGED = "as identified"
    DIFFERS = "last run differs"
    DRIFTED = "has drifted"
    IDENTIFY_AGAIN = "identify it again"


DRIFTED = (HealthVerdict.JUMPED, HealthVerdict.DRIFTED, HealthVerdict.IDENTIFY_AGAIN)
"""The verdicts that are a warning."""


class Drift(NamedTuple):
    """The drift of one quantity, in the unit of the quantity.

    before         value at the identification
    now            value in the last run that measured the quantity
    change         now - before, with the standard error of both
    per_cycle      slope over the cycles since the identification; unknown for fewer than three runs
    counts         True if each of the last `LAST_RUNS` runs shows the drift, always in the same direction
    error_percent  tracking error that the drift causes, in % of the stroke
    """

    before: Estimate
    now: Estimate
    change: Estimate
    per_cycle: Estimate
    counts: bool
    error_percent: float

    @property
    def is_significant(self) -> bool:
        """True if the change in the last run exceeds `SIGNIFICANT` standard errors, so that it is not chance."""
        return _is_significant(self.change)


class Moved(NamedTuple):
    """Shift of both branches in K, and change of the stroke in %."""

    heating_k: float
    cooling_k: float
    stroke_percent: float


class WireHealth(NamedTuple):
    """The health of a wire since its last identification.

    verdict            verdict of the record about the wire
    identified         time of the last identification (ISO 8601, UTC)
    runs, cycles       runs and cycles since this identification
    all_cycles         cycles in the whole record
    drifts             drift of each quantity of `QUANTITIES`; empty before the first run
    model_moved        change of the model from the first identification of the record to the last one
    adapted_moved      change from the first identification to the last adapted model; None without adaptation
    error_percent      tracking error that the drifts cause, in % of the stroke
    allowed_percent    error that an identification leaves
    cycles_left        cycles until the error reaches the allowed error; NaN if the error is zero or has reached it
    """

    verdict: HealthVerdict
    identified: str
    runs: int
    cycles: float
    all_cycles: float
    drifts: dict[str, Drift]
    model_moved: Moved
    adapted_moved: Moved | None
    error_percent: float
    allowed_percent: float
    cycles_left: float

    def __str__(self) -> str:
        """Return the verdict as one sentence."""
        error = f"the drift causes {self.error_percent:.2g} % tracking error without a displacement sensor"
        allowed = f"an identification leaves {self.allowed_percent:.2g} %"
        match self.verdict:
            case HealthVerdict.UNKNOWN:
                return f"the drift of the wire is unknown: it needs {LAST_RUNS} runs with a displacement sensor"
            case HealthVerdict.JUMPED:
                rest = self.drifts["rest_ohm"]
                jump = f"{rest.before.value:.4g} Ω when identified, {rest.now.value:.4g} Ω in the last run"
                cure = "check crimps and strands; another wire needs its own model"
                return f"the resistance at rest has jumped: {jump}: {cure}"
            case HealthVerdict.UNCHANGED:
                return "the wire is as identified"
            case HealthVerdict.DIFFERS:
                return "the last run differs from the identification: the next run shows if the wire has drifted"
            case HealthVerdict.IDENTIFY_AGAIN:
                return f"identify the wire again: {error}, {allowed}"
        when = f": identify it again after about {self.cycles_left:.2g} cycles" if isfinite(self.cycles_left) else ""
        return f"the wire has drifted{when} ({error}, {allowed})"


def wire_health(entries: Sequence[HealthEntry], gains: Sequence[float], allowed_percent: float) -> WireHealth | None:
    """Return the health of the wire from the entries of its record; None without an identification.

    `gains` are the errors in % of the stroke for a change of each of the `QUANTITIES` by one unit, in this order.
    """
    starts = [number for number, entry in enumerate(entries) if entry.is_identification]
    if not starts:
        return None
    identified, runs = entries[starts[-1]], entries[starts[-1] + 1 :]
    drifts = {name: _drift(identified, runs, name, gain) for name, gain in zip(QUANTITIES, gains, strict=True)}
    measured = {name: drift for name, drift in drifts.items() if drift is not None}
    error = hypot(*(drift.error_percent for drift in measured.values() if drift.counts))
    cycles = sum(run.cycles for run in runs)
    first, adapted = entries[starts[0]], [run.adapted for run in runs if run.adapted is not None]
    return WireHealth(
        HealthVerdict.JUMPED if _has_jumped(entries, identified) else _verdict(runs, measured, error > allowed_percent),
        identified.begun,
        len(runs),
        cycles,
        sum(entry.cycles for entry in entries),
        measured,
        _moved(first, LoopShape(*(getattr(identified, name).value for name in LOOP))),
        _moved(first, adapted[-1]) if adapted else None,
        error,
        allowed_percent,
        cycles * (allowed_percent / error - 1.0) if 0.0 < error < allowed_percent else nan,
    )


def gains_of(found: ErrorGains, rest_ohm: float, stroke_mm: float) -> tuple[float, float, float, float]:
    """Return the errors in % of the stroke for a change of each of the `QUANTITIES` by one unit (Ω, K, K, mm).

    `rest_ohm` is the resistance at rest of the wire, and `stroke_mm` its stroke.
    """
    return found.rest / rest_ohm, found.heating_per_k, found.cooling_per_k, found.stroke / stroke_mm


def _has_jumped(entries: Sequence[HealthEntry], identified: HealthEntry) -> bool:
    """Return True if the last run that measured the resistance at rest found it outside the expected tolerance."""
    measured = [number for number, entry in enumerate(entries) if entry.rest_ohm.is_known]
    if not (measured and identified.rest_ohm.is_known) or entries[measured[-1]].is_identification:
        return False
    earlier, last = entries[: measured[-1]], entries[measured[-1]]
    expected = expected_rest(earlier, identified.model, identified.rest_ohm.value)
    return abs(last.rest_ohm.value - expected.ohm) > expected.tolerance * expected.ohm


def _is_significant(change: Estimate) -> bool:
    return abs(change.value) > SIGNIFICANT * change.error


def _verdict(runs: Sequence[HealthEntry], drifts: dict[str, Drift], is_costly: bool) -> HealthVerdict:
    if all(_count(runs, name) < LAST_RUNS for name in QUANTITIES):
        return HealthVerdict.UNKNOWN
    if any(drift.counts for drift in drifts.values()):
        return HealthVerdict.IDENTIFY_AGAIN if is_costly else HealthVerdict.DRIFTED
    if any(drift.is_significant for drift in drifts.values()):
        return HealthVerdict.DIFFERS
    is_loop_known = all(_count(runs, name) >= LAST_RUNS for name in LOOP)
    return HealthVerdict.UNCHANGED if is_loop_known else HealthVerdict.UNKNOWN


def _count(runs: Sequence[HealthEntry], name: str) -> int:
    return sum(getattr(run, name).is_known for run in runs)


def _drift(identified: HealthEntry, runs: Sequence[HealthEntry], name: str, gain: float) -> Drift | None:
    """Return the drift of the quantity `name`; None if no run has measured it, or if the identification has not."""
    before: Estimate = getattr(identified, name)
    found: list[Estimate] = [getattr(run, name) for run in runs if getattr(run, name).is_known]
    if not (found and before.is_known):
        return None
    changes = [_change(before, now) for now in found]
    last = changes[-LAST_RUNS:]
    same = len({change.value > 0.0 for change in last}) == 1
    counts = len(last) == LAST_RUNS and same and all(map(_is_significant, last))
    cycles = np.cumsum([run.cycles for run in runs])[[getattr(run, name).is_known for run in runs]]
    return Drift(before, found[-1], changes[-1], slope(cycles, found), counts, gain * abs(changes[-1].value))


def _change(before: Estimate, now: Estimate) -> Estimate:
    errors = (error for error in (before.error, now.error) if isfinite(error))
    return Estimate(now.value - before.value, hypot(*errors))


def slope(cycles: Sequence[float] | np.ndarray, values: Sequence[Estimate]) -> Estimate:
    """Return the slope of `values` over `cycles` by least squares, and its standard error.

    The error follows from the scatter of the values, or from their standard errors if these are larger: a few values
    may lie on a line by chance. Unknown for fewer than three values, and if all have the same number of cycles.
    """
    x, y = np.asarray(cycles, np.float64), np.array([one.value for one in values])
    x = x - x.mean()
    squares = float(x @ x)
    if len(x) < 3 or squares <= 0.0:
        return Estimate()
    per_cycle = float(x @ y) / squares
    residual = y - y.mean() - per_cycle * x
    of_values = np.nan_to_num([one.error for one in values])
    variance = max(float(residual @ residual) / (len(x) - 2), float(np.mean(of_values**2)))
    return Estimate(per_cycle, sqrt(variance / squares))


def _moved(first: HealthEntry, loop: LoopShape) -> Moved:
    heating_k, cooling_k = loop.heating_c - first.heating_c.value, loop.cooling_c - first.cooling_c.value
    return Moved(heating_k, cooling_k, 100.0 * (loop.stroke_mm / first.stroke_mm.value - 1.0))
