"""The metrics of a run are computed from the measured samples; missing ones cause a caveat."""

import json
from dataclasses import replace
from math import isnan, nan
from pathlib import Path

import numpy as np
import pytest

from smadrive.control.loop import LoopMetrics
from smadrive.hysteresis import DuhemModel
from smadrive.runs.log.reader import Log
from smadrive.runs.metrics.caveats import measured_caveats, run_caveats, tracking_caveats
from smadrive.runs.metrics.run import tracking_metrics
from smadrive.wire.heat_balance import HeatBalance
from smadrive.wire.identified_wire import IdentifiedWire

WIRE = DuhemModel.gaussian(
    mu_heating=90, mu_cooling=70, sigma_heating=5, sigma_cooling=5, scale=10, input_range=(0, 200)
)
BALANCE = HeatBalance(0.02, 0.01, 0.1, 22.0, 10.0, 0.1, 0.1)
APPROACH = 20


def log_of(lost):
    """Return a log of 100 rows after the approach, each with an error of 0.1 mm. The rows `lost` were not measured."""
    time_s = np.arange(APPROACH + 100.0)
    measured_mm = np.full(time_s.size, 4.9)
    measured_mm[APPROACH + np.array(lost, dtype=int)] = nan
    reference = {"times_s": [0, 120], "displacement_mm": [5, 5], "scored_from_s": APPROACH, "endless": False}
    columns = {"time_s": time_s, "setpoint_mm": np.full(time_s.size, 5.0), "displacement_mm": measured_mm}
    metadata = {"reference": json.dumps(reference), "wire": IdentifiedWire(WIRE, BALANCE).text()}
    return Log(Path("run.h5"), columns, metadata, events=(), start_time="", end_time="", version="")


@pytest.mark.parametrize(("lost", "expected"), [([], ()), ([7], ()), (range(60), ("60 of 100 samples",))])
def test_error_is_that_of_the_measured_samples(lost, expected):
    log = log_of(lost)
    metrics = tracking_metrics(log, LoopMetrics())
    assert metrics.rms_percent == pytest.approx(1.0, rel=1e-3)
    assert metrics.max_percent == pytest.approx(1.0, rel=1e-3)
    caveats = tracking_caveats(log)
    assert len(caveats) == len(expected)
    assert all(part in caveat for part, caveat in zip(expected, caveats, strict=True))


@pytest.mark.parametrize(("replaced", "is_known"), [(2, True), (30, True), (60, False)])
def test_error_is_unknown_after_a_sensor_was_replaced_for_most_of_the_run(replaced, is_known):
    log = log_of([])
    is_replaced = np.arange(APPROACH + 100) >= APPROACH + 100 - replaced
    log = replace(log, columns={**log.columns, "sensor_replaced": is_replaced.astype(float)})
    metrics = tracking_metrics(log, LoopMetrics())
    assert [isnan(metrics.rms_percent), isnan(metrics.max_percent)] == [not is_known] * 2
    caveats = tracking_caveats(log)
    assert len(caveats) == (replaced > 2)
    assert all(f"{replaced} % of the time" in caveat for caveat in caveats)


def test_error_is_unknown_if_every_sample_is_replaced_or_missing():
    log = log_of(range(60))
    is_replaced = np.arange(APPROACH + 100) >= APPROACH + 60
    log = replace(log, columns={**log.columns, "sensor_replaced": is_replaced.astype(float)})
    assert isnan(tracking_metrics(log, LoopMetrics()).rms_percent)
    assert "unknown" in tracking_caveats(log)[0]


@pytest.mark.parametrize(("contradicting", "count"), [(0, 0), (2, 0), (60, 1)])
def test_resistance_that_contradicted_the_sensor_is_a_caveat(contradicting, count):
    log = log_of([])
    is_wrong = np.arange(APPROACH + 100) < contradicting
    log = replace(log, columns={**log.columns, "resistance_wrong": is_wrong.astype(float)})
    assert len(measured_caveats(log)) == count


@pytest.mark.parametrize("has_sensor", [True, False])
@pytest.mark.parametrize(
    ("differs_mm", "deviation_mm", "samples", "count"),
    [(0.1, 0.02, 100, 0), (2.0, 0.02, 100, 1), (2.0, 1.0, 100, 0), (2.0, 0.02, 10, 1), (1.0, 0.02, 10, 0)],
)
def test_displacement_by_resistance_that_differs_is_a_caveat(has_sensor, differs_mm, deviation_mm, samples, count):
    log = log_of([] if has_sensor else range(100))
    number = np.arange(APPROACH + 100)
    believed_mm = log.columns["displacement_mm"] if has_sensor else np.linspace(2.0, 9.0, number.size)
    columns = {
        "displacement_mm": believed_mm if has_sensor else np.full(number.size, np.nan),
        "estimated_mm": believed_mm,
        "by_resistance_mm": believed_mm - np.where(number < samples, differs_mm, 0.0),
        "by_resistance_sd_mm": np.full(number.size, deviation_mm),
    }
    log = replace(log, columns={**log.columns, **columns})
    assert len(measured_caveats(log)) == count


def test_log_without_a_wire_has_no_caveat_about_its_displacement():
    log = log_of([])
    unknown = np.full(APPROACH + 100, nan)
    columns = dict.fromkeys(("estimated_mm", "by_resistance_mm", "by_resistance_sd_mm"), unknown)
    assert run_caveats(replace(log, columns={**log.columns, **columns}, metadata={})) == ()


def test_measurement_that_tripped_does_not_count():
    log = log_of([])
    tripped, wrong_mm = np.zeros(APPROACH + 100), log.columns["displacement_mm"].copy()
    tripped[-1], wrong_mm[-1] = 1.0, -40.0
    log = replace(log, columns={**log.columns, "displacement_mm": wrong_mm, "tripped": tripped})
    assert tracking_metrics(log, LoopMetrics()).max_percent == pytest.approx(1.0, rel=1e-3)
    first = replace(log, columns={name: column[-1:] for name, column in log.columns.items()})
    assert isnan(tracking_metrics(first, LoopMetrics()).max_percent)
    assert len(tracking_caveats(first)) == 1


def test_error_is_unknown_when_nothing_was_measured():
    log = log_of(range(100))
    assert isnan(tracking_metrics(log, LoopMetrics()).rms_percent)
    assert "unknown: no displacement was measured" in tracking_caveats(log)[0]


def test_caveat_of_a_run_that_ended_in_its_approach_names_the_approach():
    log = log_of([])
    ended = replace(log, columns={name: column[:APPROACH] for name, column in log.columns.items()})
    assert tracking_caveats(ended) == (
        "the tracking error is unknown: the run ended in its approach, which is not scored",
    )
