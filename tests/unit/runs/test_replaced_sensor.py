"""Readings of a displacement sensor that the resistance has replaced make no metrics."""

import json
import shutil
from dataclasses import replace
from math import isnan

import numpy as np
import pytest

from smadrive.control.controllers.interface import Command
from smadrive.control.loop import Tick
from smadrive.control.references.shapes import sine
from smadrive.devices.profile.profile import load_profile
from smadrive.hysteresis import DuhemModel
from smadrive.measurement import Measurement
from smadrive.rig.config import load_rig
from smadrive.runs.comparison.comparison import RunComparison
from smadrive.runs.cycling.cycles import CycleEvents, Cycling, cycles_of, least_current_a, metrics_of
from smadrive.runs.log.reader import read_log
from smadrive.runs.run_kind import RunKind
from smadrive.runs.run_log import TickRecorder, reference_text
from smadrive.wire.heat_balance import HeatBalance
from smadrive.wire.identified_wire import IdentifiedWire
from smadrive.wire.wire_model import travel_mm

WIRE = IdentifiedWire(
    DuhemModel.gaussian(
        mu_heating=90, mu_cooling=69, sigma_heating=5, sigma_cooling=5, scale=12, input_range=(20, 140)
    ),
    HeatBalance(0.03, 0.014, 0.8, 22.0, 16.5, -0.12, 0.15),
)
CYCLE_S, CYCLES = 20.0, 3
REFERENCE = sine(low_mm=2.0, high_mm=9.0, period_s=CYCLE_S, cycles=1.0).repeated(CYCLES, 10.0)
STUCK_MM = 11.0


def ticks():
    """Return the ticks of three cycles. The wire is 0.12 mm short of its setpoint.

    The sensor fails within the second cycle, is stuck from then on, and is replaced.
    """
    for time_s in np.arange(0.0, CYCLES * CYCLE_S, 0.05).tolist():
        setpoint_mm = REFERENCE.value_mm(time_s)
        is_stuck = time_s >= 1.5 * CYCLE_S
        moved_mm = setpoint_mm - 0.12
        measurement = Measurement(time_s, 80.0, 0.2, 3.3, STUCK_MM if is_stuck else moved_mm)
        command = Command(
            0.2, setpoint_mm=setpoint_mm, estimated_mm=moved_mm, uses_resistance=is_stuck, sensor_replaced=is_stuck
        )
        yield Tick(time_s, 0.0, measurement, command)


def recorded(folder, board="sma-reference"):
    path = folder / f"{board}.h5"
    metadata = {
        "kind": RunKind.TRACKING.value,
        "reference": reference_text(REFERENCE),
        "cycling": Cycling(CYCLES).text(),
        "wire": WIRE.text(),
        "rig": load_rig("in-process").model_dump_json(),
        "displacement_from": "sensor",
        "profiles": json.dumps({"board": load_profile(board).model_dump(mode="json")}),
    }
    with TickRecorder(path, metadata, rows=1) as recorder:
        for tick in ticks():
            recorder.tick(tick)
    return read_log(path)


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    return recorded(tmp_path_factory.mktemp("replaced"))


def test_cycles_are_measured_until_the_sensor_fails(log):
    measured, partly, unknown = cycles_of(log)
    for one in (measured, partly):
        assert one.stroke_mm == pytest.approx(7.0, abs=0.1)
        assert one.rms_percent == pytest.approx(1.0, rel=0.01)
        assert one.max_percent == pytest.approx(1.0, rel=0.01)
    assert all(map(isnan, (unknown.stroke_mm, unknown.rms_percent, unknown.max_percent)))
    assert unknown.rest_ohm == pytest.approx(16.5)
    assert unknown.temperature_max_c == 80.0


@pytest.mark.parametrize(("lost_from", "knows_stroke", "knows_error"), [(90, True, True), (30, False, False)])
def test_cycle_of_which_an_end_was_not_measured_has_no_stroke(lost_from, knows_stroke, knows_error):
    setpoint_mm = 5.5 - 3.5 * np.cos(2.0 * np.pi * np.arange(100) / 99.0)
    measured_mm = np.where(np.arange(100) < lost_from, setpoint_mm, np.nan)
    rows = np.column_stack([np.arange(100.0), setpoint_mm, measured_mm, *np.full((3, 100), 1.0)])
    found = metrics_of(1, rows, travel_mm(WIRE.model), 0.01)
    assert [isnan(found.stroke_mm), isnan(found.rms_percent)] == [not knows_stroke, not knows_error]


def test_measurement_that_tripped_is_in_no_cycle(log):
    tripped, wrong_c = np.zeros(log.columns["time_s"].size), log.columns["temperature_c"].copy()
    tripped[-1], wrong_c[-1] = 1.0, 900.0
    marked = replace(log, columns={**log.columns, "temperature_c": wrong_c, "tripped": tripped})
    assert cycles_of(marked)[-1].temperature_max_c == 80.0
    before = replace(cycles_of(log)[0], cycle=1)
    continued = {**log.metadata, "cycling": Cycling(CYCLES, (before,), "run.h5").text()}
    at_once = replace(marked.rows(tripped > 0.0), metadata=continued)
    assert cycles_of(at_once) == [before]


def test_cycles_on_a_source_that_computes_its_voltage_have_no_resistance(tmp_path):
    cycles = cycles_of(recorded(tmp_path, "tclab"))
    assert np.isnan([one.rest_ohm for one in cycles]).all()
    assert all(one.energy_j > 0.0 for one in cycles)


def test_event_of_a_cycle_has_the_metrics_of_the_log(log):
    written = []
    least_a = least_current_a(0.6, measures_resistance=True)
    events = CycleEvents(written.append, REFERENCE, Cycling(CYCLES), travel_mm(WIRE.model), least_a)
    for tick in ticks():
        events.tick(tick)
    events.finish()
    assert written == [one.event_text() for one in cycles_of(log)]
    assert "nan" in written[-1]


def test_span_of_a_run_has_no_stuck_reading(log, tmp_path):
    other = replace(log, path=tmp_path / "other.h5")
    shutil.copy(log.path, other.path)
    assert [run.span_mm for run in RunComparison((log, other)).metrics] == pytest.approx([7.0, 7.0], abs=0.1)
