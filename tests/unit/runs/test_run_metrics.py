"""The figures of a run come from what was measured, and tell what was not."""

import json
from dataclasses import replace
from math import isnan, nan
from pathlib import Path

import numpy as np
import pytest

from smadrive.control.loop import LoopMetrics
from smadrive.hysteresis import DuhemModel
from smadrive.runs.log.reader import Log
from smadrive.runs.run_metrics import tracking_caveats, tracking_metrics
from smadrive.wire.heat_balance import HeatBalance
from smadrive.wire.identified_wire import IdentifiedWire

WIRE = DuhemModel.gaussian(
    mu_heating=90, mu_cooling=70, sigma_heating=5, sigma_cooling=5, scale=10, input_range=(0, 200)
)
BALANCE = HeatBalance(0.02, 0.01, 0.1, 22.0, 10.0, 0.1, 0.1)
APPROACH = 20


def log_of(lost):
    """100 rows after the approach, each 0.1 mm beside the reference; the `lost` ones were not measured."""
    time_s = np.arange(APPROACH + 100.0)
    measured_mm = np.full(time_s.size, 4.9)
    measured_mm[APPROACH + np.array(lost, dtype=int)] = nan
    reference = {"times_s": [0, 120], "displacement_mm": [5, 5], "scored_from_s": APPROACH, "endless": False}
    columns = {"time_s": time_s, "reference_mm": np.full(time_s.size, 5.0), "displacement_mm": measured_mm}
    about = {"reference": json.dumps(reference), "wire": IdentifiedWire(WIRE, BALANCE).text()}
    return Log(Path("run.h5"), columns, about, events=(), start_time="", end_time="", version="")


@pytest.mark.parametrize(("lost", "told"), [([], ()), ([7], ()), (range(60), ("60 of 100 samples",))])
def test_samples_that_were_lost_leave_the_error_of_the_others(lost, told):
    log = log_of(lost)
    figures = tracking_metrics(log, LoopMetrics())
    assert figures.rms_percent == pytest.approx(1.0, rel=1e-3)
    assert figures.max_percent == pytest.approx(1.0, rel=1e-3)
    caveats = tracking_caveats(log)
    assert len(caveats) == len(told)
    assert all(part in caveat for part, caveat in zip(told, caveats, strict=True))


def test_without_any_the_error_is_unknown():
    log = log_of(range(100))
    assert isnan(tracking_metrics(log, LoopMetrics()).rms_percent)
    assert "unknown: no displacement was measured" in tracking_caveats(log)[0]


def test_a_run_that_ended_in_its_approach_is_not_told_to_lack_a_sensor():
    log = log_of([])
    ended = replace(log, columns={name: column[:APPROACH] for name, column in log.columns.items()})
    assert tracking_caveats(ended) == (
        "the tracking error is unknown: the run ended in its approach, which is not scored",
    )
