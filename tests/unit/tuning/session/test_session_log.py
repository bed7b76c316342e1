"""The log of a tuning session: every tick, every event, every change, and the model of every tuning in force."""

import json
import os
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from smadrive.cli.views.reports.log_report import state_of, write_log_report
from smadrive.errors import DataError
from smadrive.hysteresis.model_file import parse_model
from smadrive.runs.log.reader import ENDED_BY, INTERRUPTION, STOP, RunEvent, read_log
from smadrive.runs.metrics.run import run_metrics
from smadrive.runs.replay import replay
from smadrive.runs.run_log import record_session
from smadrive.runs.session_record import models_of, plain_events, session_ended_event, spans_of, trips_of, tunings_of
from smadrive.wire.identified_wire import IdentifiedWire
from tests.unit.tuning.conftest import BALANCE, NONE_A, currents


class Logged:
    """A session with a log. `run` returns the log; an error that ends the session is in `error`."""

    def __init__(self, rig, path):
        self.rig, self.path = rig, path
        self.error = None
        rig.recording = self.recorder

    def recorder(self, rig):
        self.opened = record_session(self.path, rig, IdentifiedWire(self.rig.model, BALANCE), caveats="[]")
        return self.opened

    def run(self, until_s):
        try:
            self.rig.run(until_s)
        except DataError as error:
            self.error = error
        return read_log(self.path)


@pytest.fixture
def logged(ruled_rig, tmp_path):
    return Logged(ruled_rig, tmp_path / "tuning.h5")


def messages(log):
    return [event.message for event in plain_events(log)]


def test_every_tick_is_a_row_in_the_time_of_the_session(logged):
    logged.rig.at(1.0, "arm")
    logged.rig.at(2.0, "track", reference="sine")
    log = logged.run(until_s=20.0)
    ticks = [tick.measurement for tick in logged.rig.ticks][:-1]  # the last tick ends the session in `record`
    time_s = log.column("time_s")
    assert time_s.size == len(ticks)
    assert (np.diff(time_s) > 0.0).all()
    np.testing.assert_allclose(np.diff(time_s), np.diff([measured.time_s for measured in ticks]), atol=1e-9)
    np.testing.assert_array_equal(log.column("temperature_c"), [measured.temperature_c for measured in ticks])
    assert log.metadata["kind"] == "tuning"


def test_modes_off_and_changes_are_events_and_each_model_is_kept(logged):
    rig = logged.rig
    rig.at(1.0, "arm")
    rig.at(2.0, "track", reference="sine")
    rig.at(8.0, "shape", key="mu_heating", value=90.5)
    rig.at(9.0, "feedback", key="closed_loop_s", value=0.5)
    rig.at(10.0, "rule", index=2, direction=1, a=-0.05, b=0.03)
    rig.at(11.0, "undo")
    rig.at(12.0, "keep", slot="A")
    rig.do(14.0, rig.page.request_off)
    log = logged.run(until_s=16.0)
    modes = [span.mode for span in spans_of(log)]
    assert [mode for mode in modes if mode != "arming"] == ["idle", "holding", "tracking", "idle", "ended"]
    for expected in ("mu_heating = 90.5", "rule 3 heating: a = -0.05, b = 0.03", "OFF", "heater off, confirmed"):
        assert expected in messages(log)
    assert "session ended: heater off, confirmed" in messages(log)
    puts = tunings_of(log)
    assert [put.model for put in puts] == [1, 2, 2, 3, 2]
    assert "mu_heating = 90.5" in puts[1].values
    assert "closed_loop_s = 0.5" in puts[2].values
    models = models_of(log)
    assert parse_model(models[1], place="1").rules == rig.model.rules
    assert parse_model(models[2], place="2").rules == rig.session.tunings.in_force.model.rules
    assert parse_model(models[3], place="3").heating_law[0][2] == -0.05


@pytest.mark.exhaustive
def test_comparison_logs_its_switches_and_scores(logged):
    rig = logged.rig
    rig.at(0.5, "keep", slot="A")
    rig.at(0.7, "feedback", key="closed_loop_s", value=0.6)
    rig.at(0.9, "keep", slot="B")
    rig.at(1.0, "arm")
    rig.at(2.0, "track", reference="sine")
    rig.at(20.0, "compare", on=True)
    log = logged.run(until_s=160.0)
    scores = rig.status["comparison"]["scores"]
    turns = [message for message in messages(log) if message.startswith("turn of ")]
    assert len(turns) == sum(cycles for _, cycles in scores.values()) >= 2
    assert "A drives" in messages(log)
    assert any(turn.startswith("turn of A: ") and turn.endswith("B drives") for turn in turns)


def test_trip_is_logged_with_its_remedy_and_the_session_goes_on(logged):
    rig = logged.rig
    rig.at(1.0, "arm")
    rig.at(2.0, "track", reference="sine")
    rig.do(10.0, rig.device.bench.sensors.faults.open_thermocouple)
    log = logged.run(until_s=14.0)
    assert any(message.startswith(rig.status["fault"][:60]) for message in messages(log))
    assert "tripped" in [span.mode for span in spans_of(log)]
    assert log.column("time_s")[-1] > 13.5
    (trip,) = trips_of(log)
    ended = (RunEvent(13.9, f"{ENDED_BY}{STOP}"), RunEvent(13.9, session_ended_event(confirmed=True)))
    banner = state_of(replace(log, events=(trip, *ended)), run_metrics(log))
    assert banner.level == "bad"
    assert trip.message in banner.text
    for cause, level in ((INTERRUPTION, "good"), (STOP, "warning")):
        ended = (RunEvent(13.9, f"{ENDED_BY}{cause}"), RunEvent(13.9, session_ended_event(confirmed=True)))
        assert state_of(replace(log, events=ended), run_metrics(log)).level == level


@pytest.mark.exhaustive
def test_models_of_an_adaptation_are_logged(logged):
    rig = logged.rig
    rig.at(0.5, "adapt", on=True)
    rig.at(1.0, "arm")
    rig.at(2.0, "track", reference="sine")
    log = logged.run(until_s=40.0)
    assert tunings_of(log)[-1].change == "adaptation"
    assert set(models_of(log)) == {put.model for put in tunings_of(log)}


def test_log_that_cannot_be_written_ends_the_session_with_the_heater_off(logged):
    rig = logged.rig
    rig.at(1.0, "arm")
    rig.at(2.0, "track", reference="sine")
    rig.do(15.0, lambda: os.close(logged.opened._file._handle))
    with pytest.raises(DataError) as error:
        rig.run(30.0)
    assert error.value.where == str(logged.path)
    assert max(tick.measurement.time_s for tick in rig.ticks) < 17.5
    assert currents(rig.ticks).max() > 0.1
    assert rig.device.bench.plant.current_a < NONE_A
    assert rig.end == "off"


def test_event_after_a_failed_write_is_dropped_without_an_error(logged):
    rig = logged.rig
    rig.do(1.0, lambda: os.close(logged.opened._file._handle))
    rig.do(1.0, rig.page.request_off)
    with pytest.raises(DataError) as error:
        rig.run(5.0)
    assert error.value.where == str(logged.path)
    assert rig.end == "off"


@pytest.mark.exhaustive
def test_session_that_is_killed_leaves_a_readable_log(logged):
    rig = logged.rig
    copies = []
    rig.at(1.0, "arm")
    rig.at(2.0, "track", reference="sine")
    rig.do(12.0, lambda: copies.append(logged.path.read_bytes()))
    logged.run(until_s=14.0)
    killed = logged.path.with_name("killed.h5")
    killed.write_bytes(copies[0])
    log = read_log(killed)
    assert 10.5 < log.column("time_s")[-1] < 12.5
    assert log.end_time == ""
    assert [span.mode for span in spans_of(log)][-1] == "tracking"
    write_log_report(killed.with_suffix(".html"), log)


@pytest.mark.exhaustive
def test_report_shows_states_and_changes_and_no_tracking_metric(logged, tmp_path):
    rig = logged.rig
    rig.at(1.0, "arm")
    rig.at(2.0, "track", reference="sine")
    rig.at(8.0, "shape", key="mu_heating", value=90.5)
    log = logged.run(until_s=12.0)
    summary = write_log_report(tmp_path / "tuning.html", log)
    page = (tmp_path / "tuning.html").read_text()
    assert np.isnan(summary.rms_percent)
    assert "RMS error" not in page
    assert "There is no reference" not in page
    for text in ("tuning session", "Changes", "mu_heating = 90.5", "Model 2", "mode: tracking"):
        assert text in page
    assert "part 1 of" not in page


def test_replay_of_a_session_is_refused_in_one_sentence(logged):
    log = logged.run(until_s=2.0)
    with pytest.raises(DataError) as error:
        replay(log)
    assert "cannot be replayed" in error.value.what
    assert "smadrive run" in error.value.cure


def test_time_of_events_does_not_decrease(logged):
    rig = logged.rig
    rig.at(1.0, "arm")
    rig.do(3.0, rig.page.request_off)
    log = logged.run(until_s=5.0)
    assert all(later.time_s >= earlier.time_s for earlier, later in pairwise(plain_events(log)))
    assert json.loads(log.metadata["rig"])["name"]
