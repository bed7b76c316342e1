"""A model from what the loop has just recorded: "fit to the last N seconds".

It runs in a process of its own below the loop's priority, and only proposes: what it finds goes through the same checks
as any other change.
"""

from __future__ import annotations

import json
import os
from concurrent.futures import Future, ProcessPoolExecutor
from multiprocessing import get_context

import numpy as np
from numpy.typing import NDArray

from smadrive.errors import IdentificationError
from smadrive.identification.wire_fit import Kind, identify_hysteresis
from smadrive.tuning.channel import COLUMNS, Rows
from smadrive.wirefile import parse_wire, wire_text

NICENESS = 10
MOST_SAMPLES = 12000
"""More are thinned."""

Array = NDArray[np.float64]


class Fitter:
    """Does one fit at a time."""

    def __init__(self) -> None:
        self._pool = ProcessPoolExecutor(1, get_context("spawn"), initializer=os.nice, initargs=(NICENESS,))

    def close(self) -> None:
        """End the process; a fit that still runs is given up."""
        self._pool.shutdown(wait=False, cancel_futures=True)

    def fit(self, rows: Rows, seconds: float, wire: str) -> Future[str]:
        """The text of a wire's file with a model of the kind in `wire`, fitted to the last `seconds` of heated rows.

        IdentificationError when they do not determine one.
        """
        wire_c, reached_mm = (rows[:, COLUMNS.index(name)] for name in ("estimated_c", "displacement_mm"))
        times_s = rows[:, COLUMNS.index("time_s")]
        used = (times_s > times_s[-1] - seconds) & np.isfinite(wire_c) & np.isfinite(reached_mm)
        if not used.any():
            raise IdentificationError(
                f"no displacement was measured on a heated wire within the last {seconds:g} s: nothing to fit"
            )
        step = max(1, int(used.sum()) // MOST_SAMPLES)
        return self._pool.submit(fit_wire, wire_c[used][::step], reached_mm[used][::step], wire)


def fit_wire(wire_c: Array, reached_mm: Array, wire: str) -> str:
    """`wire` with its model fitted to other data; see Fitter."""
    _, balance = parse_wire(wire, place="the wire in force")
    document = json.loads(wire)
    kind: Kind = document["kind"]
    sets = len(document["sets"]["centres"]) if kind == "tsfuzzy" else 0
    fit = identify_hysteresis(wire_c, reached_mm, kind, sets)
    return wire_text(fit.model, balance)
