"""A model fitted to the last N seconds of the loop.

The fit runs in a process of its own with a low priority. Its model goes through the same checks as any other change. A
running reference drives the wire through a part of its travel only, and a model of that part alone would not determine
the displacement of a cold wire. So beyond the temperatures that were driven the record is completed by samples of the
model in force, far fewer than were measured, which begin at the measured displacement.
"""

from __future__ import annotations

import json
import os
from concurrent.futures import BrokenExecutor, Future, ProcessPoolExecutor
from multiprocessing import get_context

import numpy as np
from numpy.typing import NDArray

from smadrive.errors import IdentificationError
from smadrive.hysteresis import HysteresisModel
from smadrive.identification.record import prepare
from smadrive.identification.wire import Kind, identify_hysteresis
from smadrive.tuning.link.samples import COLUMNS, Rows
from smadrive.wire.identified_wire import IdentifiedWire, parse_wire
from smadrive.wire.wire_model import travel_mm

NICENESS = 10
MAX_SAMPLES = 12000
"""A longer record is thinned."""

COMPLETING_SAMPLES = 100
"""Samples of the model in force, for each branch and each end of the travel."""

UNMET = 0.1
"""Share of the driven temperatures over which an inner branch comes near the outer one."""

AT_END = 1e-9
"""A model with less way left, in mm or relative to the measured way, is at its end already."""

MIN_MOVED = 0.1
"""Share of the travel; a shorter path is noise rather than a loop."""

DRIFTED = 0.5
"""% of the output span. Between the two halves of a sound record the fit's error differs by 0.2 at most."""

Array = NDArray[np.float64]


class Fitter:
    """Does one fit at a time."""

    def __init__(self) -> None:
        self._pool = _new_pool()

    def close(self) -> None:
        """End the process; a fit that still runs is given up."""
        self._pool.shutdown(wait=False, cancel_futures=True)

    def fit(self, rows: Rows, seconds: float, wire: str) -> Future[IdentifiedWire]:
        """A model of the kind in `wire`, fitted to the last `seconds` of heated rows.

        IdentificationError when they do not determine one.
        """
        loop = heated_loop(rows, seconds, wire)
        try:
            return self._pool.submit(fit_wire, *loop, wire)
        except BrokenExecutor:  # its process died with an earlier fit, which has reported it
            self._pool = _new_pool()
            return self._pool.submit(fit_wire, *loop, wire)


def _new_pool() -> ProcessPoolExecutor:
    return ProcessPoolExecutor(1, get_context("spawn"), initializer=os.nice, initargs=(NICENESS,))


def heated_loop(rows: Rows, seconds: float, wire: str) -> tuple[Array, Array]:
    """Wire temperature and displacement of the last `seconds`, heated and measured, without a warm-up before them.

    IdentificationError when they do not contain a full loop.
    """
    wire_c, reached_mm = (rows[:, COLUMNS.index(name)] for name in ("estimated_c", "displacement_mm"))
    times_s = rows[:, COLUMNS.index("time_s")]
    if not times_s.size:
        raise IdentificationError("nothing was recorded yet", cure="arm and start a reference, then fit")
    used = (times_s > times_s[-1] - seconds) & np.isfinite(wire_c) & np.isfinite(reached_mm)
    if not used.any():
        raise IdentificationError(
            "no displacement was measured on a heated wire: nothing to fit", where=f"the last {seconds:g} s"
        )
    driven = _warmed_up(wire_c[used])
    wire_c, reached_mm = wire_c[used][driven:], reached_mm[used][driven:]
    try:
        _check_loop(wire_c, reached_mm, parse_wire(wire, place="the wire in force").model)
    except IdentificationError as error:
        raise IdentificationError(
            f"they cannot be fitted: {error.what}",
            where=f"the last {seconds:g} s",
            value=error.value,
            limit=error.limit,
            cure="let a reference go up and down once more, then fit again, to as many seconds as that takes at least",
        ) from None
    step = max(1, wire_c.size // MAX_SAMPLES)
    return wire_c[::step], reached_mm[::step]


def _warmed_up(wire_c: Array) -> int:
    """The first sample as warm as the wire was after its largest cooling: the samples before it are the warm-up."""
    coolest_c = wire_c[np.argmax(np.maximum.accumulate(wire_c) - wire_c)]
    return int(np.argmax(wire_c >= coolest_c))


def _check_loop(wire_c: Array, reached_mm: Array, model: HysteresisModel) -> None:
    """IdentificationError unless the measured samples contain a loop: the completing samples would always."""
    cold_mm, hot_mm = travel_mm(model)
    moved_mm = float(np.ptp(reached_mm))
    if moved_mm < MIN_MOVED * abs(hot_mm - cold_mm):
        raise IdentificationError("the wire moved too little", value=f"{moved_mm:.2g} mm")
    prepare(wire_c, reached_mm, dead_band=None)


def fit_wire(wire_c: Array, reached_mm: Array, wire: str) -> IdentifiedWire:
    """`wire` with its model fitted to other data; see Fitter."""
    in_force = parse_wire(wire, place="the wire in force")
    document = json.loads(wire)
    kind: Kind = document["kind"]
    sets = len(document["sets"]["centres"]) if kind == "tsfuzzy" else 0
    completing_c, expected_mm = _completing(in_force.model, wire_c, reached_mm)
    fit = identify_hysteresis(
        np.concatenate((wire_c, completing_c)), np.concatenate((reached_mm, expected_mm)), kind, sets
    )
    measured_percent = 100.0 * fit.residual[: wire_c.size] / fit.output_span
    return IdentifiedWire(fit.model, in_force.heat_balance, (*_drifts(measured_percent), *fit.caveats))


def _drifts(residual_percent: Array) -> tuple[str, ...]:
    """A caveat when the halves of the record differ: wire or sensor has changed, and the model is a mean of both."""
    earlier, later = np.array_split(residual_percent, 2)
    percent = abs(float(np.mean(later)) - float(np.mean(earlier)))
    if percent <= DRIFTED:
        return ()
    differ = f"the two halves of its record differ by {percent:.1f} % of the output span, those of a sound one by 0.2 %"
    return (f"{differ}: a sensor or the wire may drift. Undo the fit, and find the cause before you fit again",)


def _completing(model: HysteresisModel, wire_c: Array, reached_mm: Array) -> tuple[Array, Array]:
    """Temperatures beyond the record and the displacements expected there: to the hot end and back, then the cold end.

    Both ways out begin at the displacement that was measured, wherever `model` has it: a sudden step between the two
    would contradict the record, and the fit would bend the ends of the travel to halve it. The way to the cold end
    begins on the branch from the hot end, the record on an inner one; where they have not met yet it has no samples.
    """
    cold_c, hot_c = model.input_range
    hottest, coldest = int(np.argmax(wire_c)), int(np.argmin(wire_c))
    hot = np.linspace(wire_c[hottest], max(hot_c, wire_c[hottest]), COMPLETING_SAMPLES)
    cold = np.linspace(wire_c[coldest], min(cold_c, wire_c[coldest]), COMPLETING_SAMPLES)
    path_c = np.concatenate((hot, hot[::-1], cold, cold[::-1]))
    to_hot, from_hot, to_cold, from_cold = np.split(model.simulate(np.concatenate(([cold_c], path_c)))[1:], 4)
    to_hot, to_cold = _begun_at(reached_mm[hottest], to_hot), _begun_at(reached_mm[coldest], to_cold)
    used = np.ones(path_c.size, dtype=bool)
    used[2 * COMPLETING_SAMPLES : 3 * COMPLETING_SAMPLES] = cold <= wire_c[coldest] - UNMET * np.ptp(wire_c)
    return path_c[used], np.concatenate((to_hot, from_hot, to_cold, from_cold))[used]


def _begun_at(start_mm: float, way_mm: Array) -> Array:
    """The way to an end of the travel with another beginning: what is left of it shrinks or grows in proportion."""
    end_mm, left_mm = way_mm[-1], way_mm - way_mm[-1]
    if abs(left_mm[0]) <= AT_END * max(abs(start_mm - end_mm), AT_END):
        return way_mm
    return np.asarray(end_mm + left_mm * (start_mm - end_mm) / left_mm[0])
