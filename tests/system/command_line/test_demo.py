"""The demo, as the README runs it."""

import json
import signal
import subprocess
import sys
import time
from html.parser import HTMLParser
from pathlib import Path

import pytest

from smadrive.cli.demo import _unused_folder
from smadrive.runs.log.reader import read_log

DEMO = [sys.executable, "-m", "smadrive", "demo"]


@pytest.fixture(scope="module")
def demo(tmp_path_factory):
    """The folder and the JSON result of one demo."""
    folder = tmp_path_factory.mktemp("demo")
    done = subprocess.run([*DEMO, "--json", "-o", folder], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return folder, json.loads(done.stdout)


@pytest.mark.exhaustive
def test_inverse_is_ten_times_better_than_the_plain_map_and_within_two_percent(demo):
    _, figures = demo
    assert figures["inverse"]["rms_percent"] <= 2.0
    assert figures["inverse"]["rms_percent"] <= figures["plain_map"]["rms_percent"] / 10
    assert figures["plain_map"]["rms_percent"] <= 5.0  # with the displacement sensor, the baseline is no bad controller


@pytest.mark.exhaustive
def test_both_runs_have_the_json_keys_of_a_run(demo):
    _, figures = demo
    for run in ("inverse", "plain_map"):
        assert figures[run].keys() == {"rms_percent", "max_percent", "ticks", "missed_deadlines", "trips", "log_file"}
        assert figures[run]["trips"] == 0
        assert read_log(Path(figures[run]["log_file"])).column("time_s").size == figures[run]["ticks"]


@pytest.mark.exhaustive
def test_model_has_22_rules_and_is_certified(demo):
    _, figures = demo
    assert figures["identify"]["rules"] == 22
    assert figures["identify"]["certificate"]["holds"] is True


@pytest.mark.exhaustive
def test_first_line_says_what_the_demo_does_before_the_simulator_serves(tmp_path):
    with subprocess.Popen(
        [*DEMO, "-o", tmp_path], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        first, second, third = (process.stdout.readline() for _ in range(3))
        process.send_signal(signal.SIGINT)
        process.communicate()
    assert first.startswith("demo: excites a simulated wire, identifies it, tracks a reference twice; takes")
    assert second.startswith("firmware-sim serves")
    assert "latency_ms" not in second
    assert third.endswith("s of virtual time\n")


def test_default_folder_is_one_that_is_not_in_use(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert _unused_folder().name == "smadrive-demo"
    for name in ("smadrive-demo", "smadrive-demo-2"):
        (tmp_path / name).mkdir()
    assert _unused_folder().name == "smadrive-demo-3"


class Plots(HTMLParser):
    """Counts the images in a page, and lists the addresses that a browser would fetch."""

    def __init__(self):
        super().__init__()
        self.inside, self.fetched = 0, []

    def handle_starttag(self, tag, attrs):
        for name, value in attrs:
            if name in {"src", "href"}:
                self.inside += value.startswith("data:")
                self.fetched += [value] if not value.startswith("data:") else []


@pytest.mark.exhaustive
def test_report_shows_loop_tracking_and_error_and_fetches_nothing(demo):
    folder, _ = demo
    page = (folder / "report.html").read_text()
    plots = Plots()
    plots.feed(page)
    assert plots.inside >= 3
    assert plots.fetched == []
    for title in ("The loop", "Tracking", "Error"):
        assert f"<h2>{title}</h2>" in page


@pytest.mark.exhaustive
def test_board_was_armed_and_is_off_at_the_end(demo):
    folder, _ = demo
    events = (folder / "firmware.log").read_text().splitlines()
    assert sum("armed, watchdog" in event for event in events) == 3
    assert not any("watchdog:" in event for event in events)
    assert "heater off" in events[-1]


@pytest.mark.exhaustive
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGHUP], ids=["Ctrl-C", "closed terminal"])
def test_interruption_ends_at_zero_current(tmp_path, number):
    with subprocess.Popen(
        [*DEMO, "-o", tmp_path], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        log = tmp_path / "firmware.log"
        while process.poll() is None and not (log.exists() and "armed" in log.read_text()):
            time.sleep(0.01)
        process.send_signal(number)
        _, stderr = process.communicate()
    assert process.returncode == 130, stderr
    assert "interrupted" in stderr
    assert "Traceback" not in stderr
    events = [event.partition(" s ")[2] for event in log.read_text().splitlines()]
    assert events[:2] == ["armed, watchdog 0.500 s", "disarmed"]
