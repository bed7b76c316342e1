"""A model fitted to the last N seconds of the loop.

The fit runs in a process of its own with a low priority. Its model goes through the same checks as any other change. A
running reference drives the wire through a part of its travel only, and a model of that part alone would not determine
the displacement of a cold wire. So beyond the temperatures that were driven the record is completed by samples of the
model in force, far fewer than were measured.
"""

from __future__ import annotations

import json
import os
from concurrent.futures import BrokenExecutor, Future, ProcessPoolExecutor
from multiprocessing import get_context
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from smadrive.errors import IdentificationError
from smadrive.hysteresis import HysteresisModel
from smadrive.identification.record import prepare
from smadrive.identification.wire import Kind, identify_hysteresis
from smadrive.tuning.link.samples import COLUMNS, Rows
from smadrive.wire.wire_file import parse_wire, wire_text
from smadrive.wire.wire_model import travel_mm

NICENESS = 10
MAX_SAMPLES = 12000
"""A longer record is thinned."""

COMPLETING_SAMPLES = 50
"""Samples of the model in force, for each branch and each end of the travel."""

MIN_MOVED = 0.1
"""Share of the travel; a shorter path is noise rather than a loop."""

DRIFTED = 0.5
"""% of the output span. Between the two halves of a sound record the fit's error differs by 0.2 at most."""

Array = NDArray[np.float64]


class FittedWire(NamedTuple):
    """The text of a wire file, and the reasons to distrust its model."""

    text: str
    caveats: tuple[str, ...]


class Fitter:
    """Does one fit at a time."""

    def __init__(self) -> None:
        self._pool = _new_pool()

    def close(self) -> None:
        """End the process; a fit that still runs is given up."""
        self._pool.shutdown(wait=False, cancel_futures=True)

    def fit(self, rows: Rows, seconds: float, wire: str) -> Future[FittedWire]:
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
        _check_loop(wire_c, reached_mm, parse_wire(wire, place="the wire in force")[0])
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


def fit_wire(wire_c: Array, reached_mm: Array, wire: str) -> FittedWire:
    """`wire` with its model fitted to these samples; see Fitter."""
    model, balance = parse_wire(wire, place="the wire in force")
    document = json.loads(wire)
    kind: Kind = document["kind"]
    sets = len(document["sets"]["centres"]) if kind == "tsfuzzy" else 0
    completing_c, expected_mm = _completing(model, float(wire_c.min()), float(wire_c.max()))
    fit = identify_hysteresis(
        np.concatenate((wire_c, completing_c)), np.concatenate((reached_mm, expected_mm)), kind, sets
    )
    measured_percent = 100.0 * fit.residual[: wire_c.size] / fit.output_span
    return FittedWire(wire_text(fit.model, balance), (*_drifts(measured_percent), *fit.caveats))


def _drifts(residual_percent: Array) -> tuple[str, ...]:
    """A caveat when the halves of the record differ: wire or sensor has changed, and the model is a mean of both."""
    earlier, later = np.array_split(residual_percent, 2)
    percent = abs(float(np.mean(later)) - float(np.mean(earlier)))
    if percent <= DRIFTED:
        return ()
    differ = f"the two halves of its record differ by {percent:.1f} % of the output span, those of a sound one by 0.2 %"
    return (f"{differ}: a sensor or the wire may drift. Undo the fit, and find the cause before you fit again",)


def _completing(model: HysteresisModel, low_c: float, high_c: float) -> tuple[Array, Array]:
    """Samples of `model` beyond the two temperatures: to its hot end and back, then to its cold end and back."""
    cold_c, hot_c = model.input_range
    hot = np.linspace(high_c, max(hot_c, high_c), COMPLETING_SAMPLES)
    cold = np.linspace(low_c, min(cold_c, low_c), COMPLETING_SAMPLES)
    path_c = np.concatenate((hot, hot[::-1], cold, cold[::-1]))
    return path_c, model.simulate(np.concatenate(([cold_c], path_c)))[1:]
