"""`report` with several logs shows the runs side by side: metrics, settings that differ, plots."""

import json
import shutil
import sys

import programs
import pytest

from smadrive.control.controllers.interface import Command
from smadrive.control.controllers.step import ManualStep
from smadrive.control.feedforward.displacement import HysteresisInverse
from smadrive.control.references.shapes import sine, triangle
from smadrive.display.colours import RUN_COLOURS
from smadrive.errors import DataError
from smadrive.hysteresis import DuhemModel
from smadrive.rig.config import FeedbackConfig, load_rig
from smadrive.rig.rig import Rig
from smadrive.runs.comparison.comparison import MOST_RUNS, RunComparison
from smadrive.runs.comparison.settings import MODEL, MOST_VALUES, counted, settings_of
from smadrive.runs.figures.comparison_plots import comparison_plots
from smadrive.runs.log.reader import read_log
from smadrive.runs.run_log import record_step, record_tracking
from smadrive.wire.wire_model import WireModel

WIRE = DuhemModel.gaussian(
    mu_heating=89.9, mu_cooling=69, sigma_heating=5, sigma_cooling=5, scale=12, input_range=(20, 130)
)
RIG = load_rig("in-process")


def recorded(path, rig_config, reference, from_mm=0.0):
    with Rig(rig_config) as rig:
        experiment = (
            reference.with_approach(from_mm, 5.0),
            WireModel(WIRE, rig.nominal_balance),
            HysteresisInverse(WIRE),
        )
        with record_tracking(path, rig, *experiment) as recorder:
            rig.track(*experiment, recorder.tick)
    return read_log(path)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with the logs of a run, of one with another gain and limit, and of one with another reference."""
    folder = tmp_path_factory.mktemp("compared")
    swing = sine(low_mm=2.0, high_mm=6.0, period_s=20.0, cycles=0.5)
    recorded(folder / "first.h5", RIG, swing)
    limits = RIG.limits.model_copy(update={"current_max_a": 0.5})
    slow = RIG.model_copy(update={"feedback": FeedbackConfig(closed_loop_s=0.5), "limits": limits})
    recorded(folder / "slow.h5", slow, swing, from_mm=0.1)
    recorded(folder / "ramp.h5", RIG, triangle(low_mm=2.0, high_mm=6.0, period_s=20.0, cycles=0.5))
    with Rig(RIG) as rig, record_step(folder / "warm.h5", rig, ManualStep(0.1, None, 2.0)) as recorder:
        rig.drive(_Warm(), rig.nominal_balance, recorder.tick)
    return folder


class _Warm:
    duration_s = 2.0

    def update(self, *_):
        return Command(0.1)


def report(folder, *arguments):
    command = [sys.executable, "-m", "smadrive", "report", *arguments]
    return programs.run(command, cwd=folder, capture_output=True, text=True, check=False)


@pytest.mark.exhaustive
def test_page_terminal_and_json_show_the_same_comparison(folder):
    done = report(folder, "first.h5", "slow.h5", "--json")
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert found["report_file"] == "first-comparison.html"
    first, slow = found["runs"]
    assert (first["name"], slow["name"], slow["complete"]) == ("first", "slow", True)
    assert slow["differences"]["rms_percent"] == pytest.approx(slow["rms_percent"] - first["rms_percent"])
    assert set(first["differences"].values()) == {0}
    assert set(found["settings"]) == {
        *("gain Kp", "gain Ki", "rig: limits.current_max_a", "rig: feedback.closed_loop_s"),
    }
    assert found["settings"]["rig: limits.current_max_a"] == ["0.6", "0.5"]
    page = (folder / "first-comparison.html").read_text()
    printed = report(folder, "first.h5", "slow.h5").stdout
    for text in (page, printed):
        for part in ("RMS error / %", "gain Kp", "limits.current_max_a", f"{slow['rms_percent']:.2f}"):
            assert part in text
    assert page.count("<img") == 3
    assert "http" not in page.replace("http://www.w3.org", "")


@pytest.mark.exhaustive
def test_approach_does_not_count_as_a_difference_of_the_reference(folder):
    first, slow, ramp = (settings_of(read_log(folder / f"{name}.h5")) for name in ("first", "slow", "ramp"))
    assert first["checksum of the reference"] == slow["checksum of the reference"]
    assert first["checksum of the reference"] != ramp["checksum of the reference"]


@pytest.mark.exhaustive
@pytest.mark.parametrize(("other", "setpoints"), [("slow", 1), ("ramp", 2)])
def test_different_references_with_the_same_range_are_drawn_apart(folder, other, setpoints):
    """A sine and a triangle between the same displacements, and a sine with other gains."""
    comparison = RunComparison(tuple(read_log(folder / f"{name}.h5") for name in ("first", other)))
    displacement = next(comparison_plots(comparison)).figure.axes[0]
    assert sum(drawn.get_linestyle() == "--" for drawn in displacement.get_lines()) == setpoints


def test_runs_of_different_kinds_are_compared(folder):
    comparison = RunComparison(tuple(read_log(folder / f"{name}.h5") for name in ("first", "warm", "ramp")))
    assert comparison.settings["kind of run"] == ("tracking", "manual step", "tracking")
    assert comparison.settings["model"] == ("DuhemModel", "", "DuhemModel")
    assert not any(name.startswith(("model:", "heat balance:")) for name in comparison.settings)
    rows = {name: cells for name, *cells in comparison.metric_rows()}
    assert rows["RMS error / %"][1] == "–"
    assert "displacement span, with approach / mm" in rows
    plots = list(comparison_plots(comparison))
    assert [plot.title for plot in plots] == ["Displacement", "Heat", "Temperature and displacement"]
    displacement, error = plots[0].figure.axes
    colours = [one.get_color() for one in displacement.lines if one.get_linestyle() == "-"]
    assert colours == list(RUN_COLOURS[:3])
    assert len(error.lines) == 3  # two runs with a setpoint, and zero


def test_many_values_of_a_model_are_counted():
    same = {"gain Kp": ("1", "2", "1")}
    many = {f"{MODEL}rules[{number}].a": ("1", "2", "1") for number in range(MOST_VALUES + 1)}
    assert counted({**same, **many}) == {
        **same,
        "values of the model": ("same as the first run", "9 differ from the first run", "same as the first run"),
    }
    few = dict(list(many.items())[:MOST_VALUES])
    assert counted({**same, **few}) == {**same, **few}


def test_names_tell_files_of_one_name_apart(folder):
    (folder / "again").mkdir()
    shutil.copy(folder / "first.h5", folder / "again" / "first.h5")
    logs = read_log(folder / "first.h5"), read_log(folder / "again" / "first.h5")
    names = RunComparison(logs).names
    assert names[0] != names[1]
    assert RunComparison(logs).settings == {}


def test_wrong_number_of_runs_and_a_repeated_log_are_refused(folder):
    log, other = (read_log(folder / f"{name}.h5") for name in ("first", "slow"))
    for logs in ((log,), (log, other) * MOST_RUNS, (log, other, log)):
        with pytest.raises(DataError) as error:
            RunComparison(logs)
        assert error.value.cure


@pytest.mark.parametrize(
    "arguments",
    [
        ("first.h5", "first.h5"),
        ("first.h5", "absent.h5"),
        ("first.h5", "slow.h5", "--csv", "both.csv"),
        ("first.h5", "slow.h5", "-o", "both.h5"),
        ("first.h5", "page.html"),
    ],
)
def test_mistake_writes_no_page(folder, arguments):
    (folder / "page.html").write_text("<!doctype html>")
    before = set(folder.iterdir())
    done = report(folder, *arguments)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith("smadrive: ")
    assert set(folder.iterdir()) == before
