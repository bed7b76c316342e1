"""`report` makes a page and a table with all content of a log, whatever ended the run."""

import json
import re
import shutil
import sys
from dataclasses import replace
from functools import cache
from html import unescape
from html.parser import HTMLParser

import numpy as np
import programs
import pytest

from firmware_sim.bench import simulated_device
from firmware_sim.config import load_sim
from smadrive.cli.views.reports.demo_report import DemoRun, _error_plot
from smadrive.cli.views.reports.log_report import write_log_report
from smadrive.clock import VirtualClock
from smadrive.control.feedforward.displacement import HysteresisInverse
from smadrive.control.loop import LoopMetrics
from smadrive.control.references.shapes import sine
from smadrive.devices.heater import AT_LIMIT
from smadrive.errors import DeadlineError, TripError
from smadrive.files.csv_table import read_table
from smadrive.hysteresis import DuhemModel
from smadrive.rig.config import load_rig
from smadrive.rig.rig import Rig
from smadrive.runs.figures.log_plots import log_plots
from smadrive.runs.log.reader import read_log
from smadrive.runs.metrics.caveats import run_caveats, sample_caveats, tracking_caveats
from smadrive.runs.metrics.run import tracking_metrics
from smadrive.runs.run_log import record_excitation, record_tracking
from smadrive.safety.faults import Fault
from smadrive.wire.wire_model import WireModel

WIRE = DuhemModel.gaussian(
    mu_heating=89.9, mu_cooling=69, sigma_heating=5, sigma_cooling=5, scale=12, input_range=(20, 130)
)
CAVEAT = "the bead is loose"
CAVEATS = json.dumps([CAVEAT])
PAGES = {"complete.h5": ("-o", "page.html")}
"""The options that name the page of a log."""


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    """A folder with three logs: of a complete run, of the same run as if it was killed, of a tripped experiment."""
    folder = tmp_path_factory.mktemp("logs")
    with Rig(load_rig("in-process")) as rig:
        reference = sine(low_mm=1.0, high_mm=8.0, period_s=40.0, cycles=1.0).with_approach(0.0, 5.0)
        experiment = reference, WireModel(WIRE, rig.nominal_balance), HysteresisInverse(WIRE)
        with record_tracking(folder / "complete.h5", rig, *experiment, seed="0") as recorder:
            rig.track(*experiment, recorder.tick)
            shutil.copy(folder / "complete.h5", folder / "killed.h5")
    trip(folder / "tripped.h5")
    return folder


def trip(path, breaks=lambda device: device.bench.sensors.faults.open_thermocouple()):
    device = simulated_device(load_sim("flexinol-lt-0.15mm"))
    clock = VirtualClock()
    clock.follow(device.bench.advance_to)

    def record(tick):
        recorder.tick(tick)
        if tick.time_s > 3.0:
            breaks(device)

    with Rig(load_rig("in-process"), transports={"board": device.transport(clock)}) as rig:
        excitation = rig.excitation(22.0)
        with pytest.raises(TripError), record_excitation(path, rig, excitation, caveats=CAVEATS) as recorder:
            rig.excite(excitation, record)


@cache
def report(folder, log):
    """Write the page and the table of a log. Return the JSON output, and the page."""
    command = [sys.executable, "-m", "smadrive", "report", log, "--json", "--csv", f"{log}.csv", *PAGES.get(log, ())]
    done = programs.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    figures = json.loads(done.stdout)
    return figures, (folder / figures["report_file"]).read_text()


class Page(HTMLParser):
    """Collects the titles of a page, and the addresses that a browser would fetch."""

    def __init__(self, text):
        super().__init__()
        self.titles, self.fetched, self._inside = [], [], False
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self._inside = tag in {"h2", "summary"}
        self.fetched += [value for name, value in attrs if name in {"src", "href"} and not value.startswith("data:")]

    def handle_data(self, data):
        if self._inside:
            self.titles.append(data)
        self._inside = False


def test_page_of_a_complete_run_has_its_metrics_and_configuration(logs):
    figures, text = report(logs, "complete.h5")
    assert figures["report_file"] == "page.html"
    assert figures["complete"] is True
    assert figures["kind"] == "tracking"
    assert figures["ticks"] == 901
    assert 0.0 < figures["rms_percent"] < figures["max_percent"] < 10.0
    assert figures["missed_deadlines"] == 0
    assert 20.0 < figures["energy_j"] < 80.0
    page = Page(text)
    assert page.fetched == []
    assert page.titles == [
        *("Tracking", "Heat", "Temperature and displacement", "Loop timing", "Events", "Provenance"),
        *("Rig file", "Wire: the model of the run", "Nominal heat balance", "Device profiles"),
    ]
    for part in ("sim://flexinol-lt-0.15mm", "sma-reference (smadrive)", "limits.current_max_a", "numpy 2", "seed"):
        assert part in text


def test_json_has_the_caveats_of_the_page(logs):
    figures, text = report(logs, "tripped.h5")
    assert figures["caveats"] == [CAVEAT] == list(run_caveats(read_log(logs / "tripped.h5")))
    assert CAVEAT in unescape(text)


def test_plot_without_an_error_names_the_reason(logs):
    """A wrong resistance is another caveat of the same run."""
    log = read_log(logs / "complete.h5")
    columns = {"displacement_mm": np.full(901, np.nan), "voltage_v": 6.0 * log.column("voltage_v")}
    blind = replace(log, columns={**log.columns, **columns})
    tracking = next(log_plots(blind))
    assert sample_caveats(blind)[-1] in tracking.caption
    assert tracking_caveats(blind)[-1] not in tracking.caption


def test_plot_of_the_demo_has_the_error_of_its_table(logs):
    log = read_log(logs / "complete.h5")
    figures = tracking_metrics(log, LoopMetrics())
    plot = _error_plot([DemoRun(name, log, figures) for name in ("inverse", "plain map")])
    for panel in plot.figure.axes:
        shown, (approach,) = panel.lines[0].get_ydata(), panel.patches
        assert np.nanmax(np.abs(shown)) == pytest.approx(figures.max_percent)
        assert approach.get_width() == 5.0
        assert panel.get_ylabel() == "error / % of stroke"
    assert "The approach (grey)" in plot.caption


@pytest.mark.exhaustive
def test_delay_of_ticks_is_shown_in_real_time_alone(logs, tmp_path):
    virtual = read_log(logs / "complete.h5")
    late_s = np.full_like(virtual.column("late_s"), 1e-5)
    real = replace(virtual, columns={**virtual.columns, "late_s": late_s})
    for log, panels, part in ((virtual, 1, "missed deadlines, none in virtual time"), (real, 2, "worst 0.0 ms")):
        (timing,) = (plot for plot in log_plots(log) if plot.title == "Loop timing")
        assert len(timing.figure.axes) == panels
        assert ("Virtual time" in timing.caption) == (panels == 1)
        write_log_report(tmp_path / "page.html", log)
        assert part in (tmp_path / "page.html").read_text()


@pytest.mark.exhaustive
def test_unknown_error_is_a_warning_and_not_drawn(logs, tmp_path):
    complete = read_log(logs / "complete.h5")
    unmeasured = replace(
        complete,
        columns={**complete.columns, "displacement_mm": np.full_like(complete.column("time_s"), np.nan)},
        metadata={**complete.metadata, "caveats": json.dumps(["its reference was smoothed"])},
    )
    tripped = replace(complete, columns={name: column[:40] for name, column in complete.columns.items()})
    for log, reason in ((unmeasured, "no displacement was measured"), (tripped, "the run ended in its approach")):
        tracking = next(plot for plot in log_plots(log) if plot.title == "Tracking")
        (displacement,) = tracking.figure.axes
        assert displacement.get_xlim()[1] < 1.1 * log.column("time_s")[-1]
        assert displacement.get_xlabel() == "time / s"
        assert reason in tracking.caption
        write_log_report(tmp_path / "page.html", log)
        text = (tmp_path / "page.html").read_text()
        assert f"Warning: the tracking error is unknown: {reason}" in text.partition("<h2>")[0]


@pytest.mark.exhaustive
@pytest.mark.parametrize(("measured", "text"), [(True, "sensor"), (False, "sensor (it measured nothing)")])
def test_page_marks_a_source_that_gave_no_displacement(logs, tmp_path, measured, text):
    log = read_log(logs / "complete.h5")
    if not measured:
        nothing = np.full_like(log.column("time_s"), np.nan)
        log = replace(log, columns={**log.columns, "displacement_mm": nothing})
    write_log_report(tmp_path / "page.html", replace(log, metadata={**log.metadata, "displacement_from": "sensor"}))
    assert re.search(rf"displacement from</td>\s*<td[^>]*>{re.escape(text)}<", (tmp_path / "page.html").read_text())


def test_page_without_caveats_has_no_warning(logs):
    _, text = report(logs, "complete.h5")
    assert "Warning" not in text


def test_command_at_the_limit_counts_as_limited(logs):
    figures, text = report(logs, "complete.h5")
    log = read_log(logs / "complete.h5")
    at_limit = log.column("commanded_a") >= 0.6 * AT_LIMIT
    assert at_limit.any()
    np.testing.assert_array_equal(log.column("limited")[1:] > 0, at_limit[:-1])  # the next exchange sends the command
    assert figures["limited_percent"] == pytest.approx(100.0 * at_limit.sum() / at_limit.size)
    assert ">0.0 %<" not in text
    assert "limited by current_max for the first time" in text


@pytest.mark.exhaustive
def test_page_of_a_killed_run_shows_it_until_the_kill(logs):
    figures, text = report(logs, "killed.h5")
    assert figures["report_file"] == "killed.html"
    assert figures["complete"] is False
    assert 43.0 < figures["duration_s"] < 45.0
    assert "This log has no end" in text


def test_fault_is_shown_with_its_remedy(logs):
    figures, text = report(logs, "tripped.h5")
    assert figures["complete"] is False
    assert figures["ended_by"].startswith("TripError: fault ")
    assert figures["rms_percent"] is None
    assert "thermocouple_open" in " ".join(event["message"] for event in figures["events"])
    assert any(fault.remedy in unescape(text) for fault in (Fault.SENSOR_INVALID, Fault.DEVICE_FAULT))
    assert "Tracking" not in Page(text).titles
    assert "Excitation" in Page(text).titles


@pytest.mark.exhaustive
def test_unconfirmed_heater_is_stated_at_the_head(tmp_path):
    with pytest.raises(DeadlineError):
        trip(tmp_path / "silent.h5", lambda device: device.faults.drop(10_000))
    _, text = report(tmp_path, "silent.h5")
    head = text.partition("<h2>")[0]
    assert "could NOT be confirmed off" in head
    assert "cut its supply by hand" in head


def test_table_has_every_column_and_row(logs):
    figures, _ = report(logs, "complete.h5")
    table = read_table(logs / figures["csv_file"])
    assert next(iter(table.cells)) == "time_s"
    assert {"temperature_c", "displacement_mm", "current_a", "setpoint_mm", "late_s", "limited"} <= table.cells.keys()
    assert table.column("time_s").size == figures["ticks"]
    assert np.all(np.diff(table.column("time_s")) > 0)
