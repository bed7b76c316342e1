"""`run --repeat` measures every cycle, and `--resume` runs the cycles that are left, without touching the first log."""

import json
import signal
import subprocess
import sys
import time
from contextlib import nullcontext, suppress
from dataclasses import asdict
from math import isnan

import numpy as np
import programs
import pytest
from marks import exhaustive

from smadrive.cli.views.reports.log_report import write_log_report
from smadrive.control.references.reference import Reference
from smadrive.control.references.shapes import sine
from smadrive.errors import ConfigError, DataError
from smadrive.files.shipped import configs_dir
from smadrive.hysteresis import DuhemModel
from smadrive.measurement import DisplacementFrom
from smadrive.rig.config import load_rig
from smadrive.rig.rig import Rig
from smadrive.runs.cycling.continuation import continuation_of
from smadrive.runs.cycling.cycle_table import thinned
from smadrive.runs.cycling.cycles import Cycling, cycles_of, cycling_of, metrics_of
from smadrive.runs.experiments import track
from smadrive.runs.log.reader import read_log
from smadrive.runs.replay import replay
from smadrive.runs.tracking_plan import plan_tracking
from smadrive.wire.identified_wire import IdentifiedWire
from smadrive.wire.wire_model import Travel

RIG = load_rig("in-process")
WIRE = IdentifiedWire(
    DuhemModel.gaussian(
        mu_heating=89.9, mu_cooling=69, sigma_heating=5, sigma_cooling=5, scale=12, input_range=(20, 130)
    ),
    None,
)
SWING = sine(low_mm=2.0, high_mm=6.0, period_s=12.0, cycles=1.0)
TOTAL = 4


def run_cycles(path, ends_after_s=1e9, displacement_from=None):
    """Record a run of `TOTAL` cycles, interrupted after `ends_after_s`."""

    def watch(recorder, _duration_s):
        def record(tick):
            recorder.tick(tick)
            if tick.time_s > ends_after_s:
                raise KeyboardInterrupt

        return nullcontext(record)

    with Rig(RIG) as rig:
        options = {"smooth": True, "smooth_option": "--smooth", "displacement_from": displacement_from}
        plan = plan_tracking(rig, SWING, WIRE, cycling=Cycling(TOTAL), **options)
        track(path, rig, plan, watch)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with a complete run, one that was interrupted in its third cycle, and the file of the wire."""
    folder = tmp_path_factory.mktemp("cycles")
    run_cycles(folder / "whole.h5")
    with pytest.raises(KeyboardInterrupt):
        run_cycles(folder / "part.h5", ends_after_s=10.0 + 2.5 * 12.0)
    return folder


def smadrive(folder, *arguments):
    command = [sys.executable, "-m", "smadrive", *map(str, arguments)]
    return programs.run(command, cwd=folder, capture_output=True, text=True, check=False)


@pytest.mark.exhaustive
def test_every_cycle_is_measured_and_the_run_replays(folder):
    log = read_log(folder / "whole.h5")
    cycles = cycles_of(log)
    assert [one.cycle for one in cycles] == [1, 2, 3, 4]
    for one in cycles:
        assert one.stroke_mm == pytest.approx(4.0, abs=0.5)
        assert 0.0 < one.rms_percent < one.max_percent < 10.0
        assert 15.0 < one.rest_ohm < 17.0
    power_w = log.column("current_a") * log.column("voltage_v")
    scored = log.column("time_s") >= 10.0
    assert sum(one.energy_j for one in cycles) == pytest.approx(power_w[scored].sum() / 20.0, rel=0.02)
    assert replay(log).exact


@pytest.mark.exhaustive
def test_log_has_an_event_for_each_cycle_and_the_report_a_table_and_a_plot(folder, tmp_path):
    log = read_log(folder / "whole.h5")
    written = [event.message for event in log.events if event.message.startswith("cycle ")]
    assert written == [one.event_text() for one in cycles_of(log)]
    write_log_report(tmp_path / "page.html", log)
    page = (tmp_path / "page.html").read_text()
    for part in ("<h2>Cycles</h2>", "at rest / Ω", "4 of 4 cycles are complete"):
        assert part in page
    assert written[0] not in page
    write_log_report(tmp_path / "page.html", read_log(folder / "part.h5"))
    assert "2 of 4 cycles are complete" in (tmp_path / "page.html").read_text()


@pytest.mark.exhaustive
def test_resumed_run_does_the_rest_and_leaves_the_first_log(folder):
    before = (folder / "part.h5").read_bytes()
    done = smadrive(folder, "run", "in-process", "--resume", "part.h5", "-o", "rest.h5", "--smooth", "--json")
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    assert (folder / "part.h5").read_bytes() == before
    assert [one["cycle"] for one in result["cycles"]] == [1, 2, 3, 4]
    assert result["cycles_planned"] == 4
    assert result["cycles"][:2] == [asdict(one) for one in cycles_of(read_log(folder / "part.h5"))]
    rest = read_log(folder / "rest.h5")
    assert rest.column("time_s")[-1] == pytest.approx(10.0 + 2 * 12.0, abs=0.1)
    whole = smadrive(folder, "report", "rest.h5", "--json")
    assert len(json.loads(whole.stdout)["cycles"]) == 4
    assert "those of part.h5" in (folder / "rest.html").read_text()
    again = smadrive(folder, "run", "in-process", "--resume", "rest.h5", "-o", "more.h5")
    assert again.returncode == 2
    assert "all cycles are done" in again.stderr


@pytest.mark.parametrize("options", [exhaustive(("--smooth",)), ("--smooth", "--trace", "traces")])
def test_resumed_run_says_which_cycles_it_does_and_that_smooth_applies(folder, tmp_path, options):
    log_file = tmp_path / "rest.h5"
    done = smadrive(folder, "run", "in-process", "--resume", "part.h5", "-o", log_file, *options)
    assert done.returncode == 0, done.stderr
    (line,) = [line for line in done.stdout.splitlines() if line.startswith("resuming ")]
    assert "part.h5" in line
    assert "3 to 4" in line
    assert "--smooth" in line
    assert "given_reference" in read_log(log_file).metadata
    assert (folder / "traces" / "board.trace").exists() is ("--trace" in options)


@pytest.mark.exhaustive
def test_resumed_run_has_the_source_of_the_displacement_of_its_log(tmp_path):
    with pytest.raises(KeyboardInterrupt):
        run_cycles(tmp_path / "part.h5", 10.0 + 3.1 * 12.0, DisplacementFrom.NONE)
    done = smadrive(tmp_path, "run", "in-process", "--resume", "part.h5", "-o", "rest.h5", "--smooth")
    assert done.returncode == 0, done.stderr
    assert read_log(tmp_path / "rest.h5").text("displacement_from") == DisplacementFrom.NONE


@pytest.mark.parametrize(("in_file", "kept"), [("sensor", None), ("none", DisplacementFrom.SENSOR)])
def test_source_of_the_log_is_a_choice_if_the_rig_file_names_another(folder, in_file, kept):
    config = RIG.model_copy(update={"displacement_from": DisplacementFrom(in_file)})
    assert continuation_of(folder / "part.h5", config).displacement_from is kept


def test_another_source_of_the_displacement_is_a_caveat_of_a_resumed_run(folder):
    same = continuation_of(folder / "part.h5", RIG, DisplacementFrom.SENSOR)
    assert (same.displacement_from, same.caveats) == (DisplacementFrom.SENSOR, ())
    other = continuation_of(folder / "part.h5", RIG, DisplacementFrom.NONE)
    assert (other.displacement_from, len(other.caveats)) == (DisplacementFrom.NONE, 1)


@pytest.mark.parametrize(
    ("arguments", "part"),
    [
        (("--reference", "sine:low_mm=2,high_mm=6,period_s=12"), "--reference"),
        (("--repeat", "3"), "--repeat"),
        (("--model", "wire.json"), "--model"),
        (("-o", "part.h5"), "never overwritten"),
    ],
)
def test_resume_refuses_what_its_log_gives(folder, arguments, part):
    given = arguments if "-o" in arguments else (*arguments, "-o", "other.h5")
    done = smadrive(folder, "run", "in-process", "--resume", "part.h5", *given)
    assert (done.returncode, done.stdout) == (2, "")
    assert part in done.stderr
    assert not (folder / "other.h5").exists()


@pytest.mark.parametrize(
    ("arguments", "part"),
    [
        ((), "--reference: is missing"),
        (("--reference", "sine:low_mm=2,high_mm=6,period_s=12", "--repeat", "0"), "--repeat"),
        (("--resume", "absent.h5"), "no such file"),
    ],
)
def test_mistake_of_a_run_is_a_usage_error(folder, arguments, part):
    done = smadrive(folder, "run", "in-process", "-o", "other.h5", *arguments)
    assert (done.returncode, done.stdout) == (2, "")
    assert part in done.stderr


@pytest.mark.exhaustive
def test_way_back_of_a_cycle_is_a_caveat_of_the_run(folder):
    (folder / "wire.json").write_text(WIRE.text())
    ramp = ("--reference", "trapezoid:low_mm=2,high_mm=4,rise_s=8,dwell_s=1,cycles=0.5", "--smooth", "--repeat", "2")
    done = smadrive(folder, "run", "in-process", "--model", "wire.json", *ramp, "-o", "ramp.h5", "--json")
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    assert "way back of 10 s" in result["caveats"][0]
    assert len(result["cycles"]) == 2


def test_continuation_needs_cycles_and_the_same_wire(folder):
    other = RIG.model_copy(update={"wire": "other-wire"})
    with pytest.raises(ConfigError) as error:
        continuation_of(folder / "part.h5", other)
    assert (error.value.value.split(",")[0], error.value.limit) == ("other-wire", None)
    changed = RIG.model_copy(update={"rate_hz": 10.0})
    (caveat,) = continuation_of(folder / "part.h5", changed).caveats
    assert "rate_hz was 20.0, is 10.0" in caveat
    with pytest.raises(DataError):
        continuation_of(folder / "whole.h5", RIG)


def test_warning_of_a_changed_rig_is_short_and_names_the_lost_sensor(folder):
    (board,) = RIG.devices
    changed = RIG.model_copy(
        update={
            "devices": (board.model_copy(update={"measures": ("temperature",), "name": "b" * 500}),),
            "limits": RIG.limits.model_copy(update={"stale_after_s": 0.5, "watchdog_s": 1.0}),
            "rate_hz": 10.0,
        }
    )
    (caveat,) = continuation_of(folder / "part.h5", changed).caveats
    assert len(caveat) < 250
    assert caveat.count(". ") == 1
    assert "displacement" in caveat


@pytest.mark.exhaustive
def test_warning_of_a_resumed_run_is_printed_once(folder, tmp_path):
    text = (configs_dir() / "rigs" / "in-process.toml").read_text()
    (tmp_path / "rig.toml").write_text(text.replace("watchdog_s = 0.5", "watchdog_s = 0.6"))
    resumed = ("--resume", folder / "part.h5", "-o", tmp_path / "rest.h5", "--smooth")
    done = smadrive(folder, "run", tmp_path / "rig.toml", *resumed)
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("watchdog_s was 0.5") == 1
    assert any("watchdog_s was 0.5" in caveat for caveat in read_log(tmp_path / "rest.h5").json("caveats"))


def test_repeated_reference_closes_its_cycles_and_ends():
    ramp = Reference.from_samples([0.0, 10.0], [2.0, 6.0]).with_approach(0.0, 5.0).repeated(3, 4.0)
    assert ramp.cycle_s == pytest.approx(14.0)
    assert ramp.duration_s == pytest.approx(5.0 + 3 * 14.0)
    for cycle in range(3):
        assert ramp.value_mm(5.0 + 14.0 * cycle + 5.0) == pytest.approx(4.0)
    assert ramp.value_mm(ramp.duration_s) == ramp.value_mm(ramp.duration_s + 100.0) == pytest.approx(2.0)
    assert ramp.next_reversal_s(40.0, 1) == pytest.approx(5.0 + 28.0 + 10.0)
    assert ramp.next_reversal_s(44.0, -1) == np.inf
    swing = SWING.repeated(5, 4.0)
    assert swing.duration_s == pytest.approx(60.0)
    assert swing.next_reversal_s(50.0, -1) == pytest.approx(np.inf)
    with pytest.raises(DataError):
        SWING.repeated(100_000, 4.0)


def test_cycle_without_current_or_displacement_has_unknown_metrics():
    rows = np.array([[n, 2.0, np.nan, 20.0, 0.0, 0.0] for n in range(5)])
    metrics = metrics_of(7, rows, Travel(0.0, 12.0), 0.01)
    assert metrics.cycle == 7
    assert all(map(isnan, (metrics.stroke_mm, metrics.rms_percent, metrics.max_percent, metrics.rest_ohm)))
    assert metrics.energy_j == 0.0


def test_long_table_is_thinned_to_its_ends(folder):
    (first, *_) = cycles_of(read_log(folder / "whole.h5"))
    many = [type(first)(**{**asdict(first), "cycle": n}) for n in range(1, 1001)]
    shown = thinned(many, 20)
    assert (len(shown), shown[0].cycle, shown[-1].cycle) == (20, 1, 1000)
    assert thinned(many[:5], 20) == many[:5]


def has_rows(log_file):
    with suppress(DataError):
        return read_log(log_file).column_with_gaps("time_s").size > 0
    return False


@pytest.mark.exhaustive
def test_interruption_names_the_log_and_how_to_resume(tmp_path):
    swing = ("--reference", "sine:low_mm=2,high_mm=6,period_s=12,cycles=1", "--repeat", "1000", "--smooth")
    (tmp_path / "wire.json").write_text(WIRE.text())
    command = [sys.executable, "-m", "smadrive", "run", "in-process", "--model", "wire.json", *swing, "-o", "part.h5"]
    with programs.Program(command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        while not has_rows(tmp_path / "part.h5"):
            assert process.poll() is None
            time.sleep(0.05)
        process.send_signal(signal.SIGINT)
        _, stderr = process.communicate()
    assert process.returncode == 130, stderr
    (line,) = [line for line in stderr.splitlines() if "--resume part.h5" in line]
    assert line.startswith("smadrive: part.h5 ")
    assert cycling_of(read_log(tmp_path / "part.h5")).total == 1000
    assert not [event for event in read_log(tmp_path / "part.h5").events if "--resume" in event.message]
