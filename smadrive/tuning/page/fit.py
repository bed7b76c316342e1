"""Fits a model to the last seconds of the run, for the button Fit of the page.

The fit runs in a separate process, with the priority of the page process. With a lower priority, a browser that keeps
every core busy would delay the fit, and the user waits for the fit. A fit to 80 s takes 1 to 3 s of processor time.
Before the first fit, the start of the process takes another 0.7 s. The fitted model must pass the same checks as any
other change.

A running reference moves the wire through only a part of its travel, and such a record does not determine the
displacement of a cold wire. So the record is completed: for temperatures outside the record, samples of the model in
force are added, usually far fewer than were measured. The added samples begin at the measured displacement.
"""

from __future__ import annotations

import json
import os
import threading
from concurrent.futures import BrokenExecutor, Future, ProcessPoolExecutor
from dataclasses import replace
from math import isnan
from multiprocessing import Pipe, get_context
from multiprocessing.connection import Connection
from typing import Any

import numpy as np

from smadrive.errors import ConfigError, IdentificationError
from smadrive.hysteresis import HysteresisModel
from smadrive.identification.record import prepare
from smadrive.identification.wire import FitSettings, identify_hysteresis
from smadrive.numerics.arrays import FloatArray
from smadrive.stream.samples import COLUMN, Rows
from smadrive.wire.identified_wire import IdentifiedWire, parse_wire
from smadrive.wire.wire_model import travel_mm

MAX_SAMPLES = 12000
"""A fit uses every n-th sample of a record: n is the number of samples divided by this, rounded down, at least 1."""

COMPLETING_SAMPLES = 100
"""Samples on each of four ways: to the hot end of the travel and back, to the cold end and back.

Fewer are added on the way to the cold end (see UNMET).
"""

UNMET = 0.1
"""Share of the recorded temperature range.

On the way to the cold end, samples are added only at temperatures that are lower than the coldest measured sample by at
least this share. Over this distance, an inner branch comes near the branch of the major loop.
"""

AT_END = 1e-9
"""If the model begins a way this near to the end of the travel, `_begun_at` does not scale the way.

The distance of the model from the end is given as a share of the distance of the measured displacement from the end.
"""

MIN_MOVED = 0.1
"""Least movement of the wire for a fit, as a share of the stroke of the model. A smaller one is refused as noise."""

DRIFTED = 0.5
"""Largest difference between the mean fit errors of the two halves of a record without a caveat, % of the output span.

In a sound record the difference is at most 0.2 %.
"""

ARM_AND_START = "arm and start a reference, then fit"


class Fitter:
    """Fits models in a process of its own, one at a time."""

    def __init__(self) -> None:
        self._pool, self._link = _new_pool()

    def close(self) -> None:
        """End the process. A fit that still runs is lost: its future raises BrokenExecutor."""
        self._pool.shutdown(wait=False, cancel_futures=True)
        self._link.close()

    def fit(self, rows: Rows, seconds: float, wire: str) -> Future[IdentifiedWire]:
        """Begin to fit a model to the rows of the last `seconds` in which the wire was heated.

        Return the future of the fitted wire. `wire` is the text of the wire in force; the new model is of the same
        kind. IdentificationError when the rows do not determine a model. ConfigError if `seconds` is NaN.
        """
        if isnan(seconds):
            raise ConfigError("the field beside Fit is empty", cure="type a number of seconds into the field")
        loop = heated_loop(rows, seconds, wire)
        try:
            return self._pool.submit(fit_wire, *loop, wire)
        except BrokenExecutor:  # the process died during an earlier fit, which has reported the death
            self._pool, self._link = _new_pool()
            return self._pool.submit(fit_wire, *loop, wire)


def _new_pool() -> tuple[ProcessPoolExecutor, Connection[Any, Any]]:
    """Return a pool of one process, and the link that ends it: when the link is closed, or when this process dies."""
    far_end, link = Pipe(duplex=False)
    return ProcessPoolExecutor(1, get_context("spawn"), _end_with, (far_end,)), link


def _end_with(link: Connection[Any, Any]) -> None:
    """End this process when the other end of `link` is closed. Otherwise an orphan waits for its next task for ever."""

    def wait() -> None:
        link.poll(None)
        os._exit(0)

    threading.Thread(target=wait, daemon=True).start()


def heated_loop(rows: Rows, seconds: float, wire: str) -> tuple[FloatArray, FloatArray]:
    """Return the wire temperatures in °C and the displacements in mm of the last `seconds`, each of shape (samples,).

    Samples without heating or without a measured displacement, and the warm-up at the beginning, are left out. Long
    records are thinned out (see MAX_SAMPLES). `wire` is the text of the wire in force. IdentificationError when no
    samples remain, when the wire moved too little, or when the samples do not contain a full loop.
    """
    wire_c, reached_mm = (rows[:, COLUMN[name]] for name in ("estimated_c", "displacement_mm"))
    times_s = rows[:, COLUMN["time_s"]]
    if not times_s.size:
        raise IdentificationError("nothing was recorded yet", cure=ARM_AND_START)
    used = (times_s > times_s[-1] - seconds) & np.isfinite(wire_c) & np.isfinite(reached_mm)
    if not used.any():
        raise IdentificationError(
            "no displacement was measured on a heated wire",
            where=f"the last {seconds:g} s",
            cure=f"check the displacement sensor, {ARM_AND_START}",
        )
    driven = _warmed_up(wire_c[used])
    wire_c, reached_mm = wire_c[used][driven:], reached_mm[used][driven:]
    try:
        _check_loop(wire_c, reached_mm, parse_wire(wire, place="the wire in force").model)
    except IdentificationError as error:
        raise IdentificationError(
            f"this record cannot be fitted: {error.what}",
            where=f"the last {seconds:g} s",
            value=error.value,
            limit=error.limit,
            cure="let a reference go up and down once more, then fit again; the seconds must include this movement",
        ) from None
    step = max(1, wire_c.size // MAX_SAMPLES)
    return wire_c[::step], reached_mm[::step]


def _warmed_up(wire_c: FloatArray) -> int:
    """Return the number of samples of the warm-up at the beginning of `wire_c`.

    The largest cooling is the largest drop below the highest earlier temperature. The warm-up ends at the first sample
    that is at least as warm as the wire was at the end of the largest cooling.
    """
    coolest_c = wire_c[np.argmax(np.maximum.accumulate(wire_c) - wire_c)]
    return int(np.argmax(wire_c >= coolest_c))


def _check_loop(wire_c: FloatArray, reached_mm: FloatArray, model: HysteresisModel) -> None:
    """Raise IdentificationError if the wire moved too little, or if the measured samples contain no full loop.

    This check comes before `_completing` adds samples, because the added samples always contain a loop.
    """
    moved_mm = float(np.ptp(reached_mm))
    least_mm = MIN_MOVED * travel_mm(model).stroke_mm
    if moved_mm < least_mm:
        raise IdentificationError("the wire moved too little", value=f"{moved_mm:.2g} mm", limit=f"{least_mm:.2g} mm")
    prepare(wire_c, reached_mm, dead_band=None)


def fit_wire(wire_c: FloatArray, reached_mm: FloatArray, wire: str) -> IdentifiedWire:
    """Return `wire` with a model of the same kind, fitted to the given samples.

    `wire_c` and `reached_mm` are wire temperature and displacement, of shape (samples,); `wire` is the text of the wire
    in force.
    """
    in_force = parse_wire(wire, place="the wire in force")
    document = json.loads(wire)
    settings = FitSettings(document["kind"])
    if settings.kind == "tsfuzzy":
        memory = None if "memory" in document else 1
        settings = settings._replace(sets=len(document["sets"]["centres"]), memory=memory)
    completing_c, expected_mm = _completing(in_force.model, wire_c, reached_mm)
    fit = identify_hysteresis(
        np.concatenate((wire_c, completing_c)), np.concatenate((reached_mm, expected_mm)), settings
    )
    measured_percent = 100.0 * fit.residual[: wire_c.size] / fit.output_span
    return replace(in_force, model=fit.model, caveats=(*_drifts(measured_percent), *fit.caveats), source="")


def _drifts(residual_percent: FloatArray) -> tuple[str, ...]:
    """Return one caveat if the mean fit errors of the two halves of the record differ, otherwise an empty tuple.

    `residual_percent` is the fit error of each sample in % of the output span. If the wire or a sensor changes during
    the record, the means differ, and the model fits neither half well.
    """
    earlier, later = np.array_split(residual_percent, 2)
    percent = abs(float(np.mean(later)) - float(np.mean(earlier)))
    if percent <= DRIFTED:
        return ()
    differ = f"the two halves of the record differ by {percent:.1f} % of the output span, more than {DRIFTED:g} %"
    return (f"{differ}: a sensor or the wire may drift. Undo the fit, and find the cause before you fit again",)


def _completing(model: HysteresisModel, wire_c: FloatArray, reached_mm: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return temperatures (°C) outside the record, and the displacements (mm) that `model` expects at them.

    The path leads to the hot end of the travel and back, then to the cold end and back. The way to each end begins at
    the measured displacement, even if `model` expects a different displacement. A step between the record and the added
    samples would contradict the record, and the fit would bend the ends of the travel to reduce the step.

    `model` goes to the cold end along the cooling branch of the major loop, but the record lies on an inner branch. So
    no sample is added where these two branches still differ (see UNMET).
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


def _begun_at(start_mm: float, way_mm: FloatArray) -> FloatArray:
    """Scale the displacements `way_mm`, so that they begin at `start_mm` and still end at the end of the travel.

    Return the scaled displacements, or `way_mm` itself if the scaling is impossible (see AT_END).
    """
    end_mm, left_mm = way_mm[-1], way_mm - way_mm[-1]
    if abs(left_mm[0]) <= AT_END * max(abs(start_mm - end_mm), AT_END):
        return way_mm
    return np.asarray(end_mm + left_mm * (start_mm - end_mm) / left_mm[0])
