"""`heat` holds a current or a temperature, within the limits of its rig, and records it like every run."""

import json
import shutil
import sys
from contextlib import nullcontext
from math import isnan, nan
from pathlib import Path

import numpy as np
import programs
import pytest

from smadrive.control.controllers.step import ManualStep
from smadrive.errors import ConfigError, TripError
from smadrive.rig.checks.limits import check_step
from smadrive.rig.config import load_rig
from smadrive.rig.rig import Rig
from smadrive.runs.experiments import heat
from smadrive.runs.log.reader import read_log
from smadrive.runs.metrics.step import step_caveats, step_metrics
from smadrive.runs.replay import replay
from smadrive.safety.shutdown import shutdown_of

CONFIGS = Path(__file__).parents[3] / "configs"
CLOSED = Rig(load_rig("in-process"))


def smadrive(*arguments, cwd):
    command = [sys.executable, "-m", "smadrive", *map(str, arguments)]
    return programs.run(command, cwd=cwd, capture_output=True, text=True, check=False)


def recorded(path, step, record=lambda recorder: recorder.tick):
    with Rig(load_rig("in-process")) as rig:
        heat(path, rig, step, lambda recorder, _duration_s: nullcontext(record(recorder)))
    return read_log(path)


def test_temperature_is_held_and_the_log_replays(tmp_path):
    log = recorded(tmp_path / "warm.h5", ManualStep(None, 60.0, 20.0))
    is_settled = log.column("time_s") > 10.0
    np.testing.assert_allclose(log.column("temperature_c")[is_settled], 60.0, atol=1.0)
    assert log.column("temperature_c").max() < 62.0
    assert log.column("time_s")[-1] == pytest.approx(20.0, abs=0.1)
    assert step_caveats(log) == ()
    assert step_metrics(log).resistance_end_ohm == pytest.approx(16.5, abs=0.2)
    assert replay(log).exact


def test_current_is_held_and_ends_at_zero(tmp_path):
    done = smadrive("heat", "in-process", "--current", 0.15, "--for", 5, "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    assert (result["current_a"], result["temperature_c"], result["duration_s"]) == (0.15, None, 5.0)
    assert (result["ticks"], result["trips"], result["log_file"]) == (101, 0, "heat.h5")
    log = read_log(tmp_path / "heat.h5")
    assert set(log.column("commanded_a")) == {0.15}
    assert result["energy_j"] == pytest.approx(0.15**2 * 16.5 * 5.0, rel=0.05)
    text = smadrive("heat", "in-process", "--current", 0.1, "--for", 1, cwd=tmp_path).stdout
    assert "heat-2.h5: the step takes 1 s of virtual time" in text
    assert "resistance at the end" in text
    assert smadrive("report", "heat.h5", cwd=tmp_path).returncode == 0
    page = (tmp_path / "heat.html").read_text()
    assert "manual step" in page
    assert "Step" in page
    assert "<td>null</td>" not in page


def test_step_that_trips_ends_with_its_metrics(tmp_path):
    with pytest.raises(TripError):
        recorded(tmp_path / "hot.h5", ManualStep(0.6, None, 10.0))
    log = read_log(tmp_path / "hot.h5")
    assert log.ended_by.startswith("TripError")
    assert "temperature_max_c = 135 °C" in log.json("caveats")[0]
    assert step_metrics(log).current_end_a > 0.1


def test_temperature_that_is_not_reached_is_a_caveat(tmp_path):
    (caveat,) = step_caveats(recorded(tmp_path / "short.h5", ManualStep(None, 100.0, 1.0)))
    assert "its setpoint was 100 °C" in caveat


def test_other_resistance_than_that_of_the_data_sheet_is_a_caveat(tmp_path):
    wire = (CONFIGS / "wires" / "flexinol-lt-0.15mm.toml").read_text()
    (tmp_path / "wire.toml").write_text(wire.replace("resistance_ohm_per_m = 55.0", "resistance_ohm_per_m = 25.0"))
    with Rig(CLOSED.config.model_copy(update={"wire": str(tmp_path / "wire.toml")})) as rig:
        step = ManualStep(0.1, None, 2.0)
        heat(tmp_path / "warm.h5", rig, step, lambda recorder, _duration_s: nullcontext(recorder.tick))
    (caveat,) = step_caveats(read_log(tmp_path / "warm.h5"))
    assert "resistance_ohm_per_m" in caveat


def test_interruption_ends_at_zero_current(tmp_path):
    def interrupting(recorder):
        def record(tick):
            recorder.tick(tick)
            if tick.time_s > 2.0:
                raise KeyboardInterrupt

        return record

    with pytest.raises(KeyboardInterrupt) as caught:
        recorded(tmp_path / "cut.h5", ManualStep(0.2, None, 100.0), interrupting)
    assert shutdown_of(caught.value).confirmed
    log = read_log(tmp_path / "cut.h5")
    assert log.ended_by.startswith("interruption")
    assert 2.0 < log.column("time_s")[-1] < 2.2


@pytest.mark.parametrize(
    ("step", "where", "limit"),
    [
        ((0.7, None, 1.0), "step: current", "current_max_a = 0.6 A"),
        ((0.0, None, 1.0), "step: current", "above 0 A"),
        ((nan, None, 1.0), "step: current", "above 0 A"),
        ((None, 131.0, 1.0), "step: temperature", "130 °C"),
        ((None, nan, 1.0), "step: temperature", "130 °C"),
        ((None, 20.0, 1.0), "step: temperature", "ambient_c = 22 °C"),
        ((None, 60.0, 0.0), "step: duration", "86400 s"),
        ((None, 60.0, nan), "step: duration", "86400 s"),
        ((0.1, None, 1e9), "step: duration", "86400 s"),
        ((None, None, 1.0), "step", "None"),
        ((0.1, 60.0, 1.0), "step", "None"),
    ],
)
def test_step_beyond_a_limit_is_refused_before_a_port_is_opened(step, where, limit):
    with pytest.raises(ConfigError) as error:
        check_step(ManualStep(*step), CLOSED.config, CLOSED.data_sheet)
    assert error.value.where == where
    assert limit in str(error.value.limit)
    assert error.value.cure
    assert (error.value.what == "not a number") is any(value is not None and isnan(value) for value in step)


@pytest.mark.parametrize(("temperature", "is_kelvin"), [(353.0, True), (180.0, False), (500.0, False)])
def test_cure_suggests_kelvin_only_for_a_possible_temperature(temperature, is_kelvin):
    with pytest.raises(ConfigError) as error:
        check_step(ManualStep(None, temperature, 1.0), CLOSED.config, CLOSED.data_sheet)
    assert ("353 K is 80 °C" in error.value.cure) is is_kelvin


def test_limits_are_checked_before_the_port(tmp_path):
    done = smadrive("heat", "simulated", "--current", 2, "--for", 1, cwd=tmp_path)
    assert (done.returncode, done.stdout) == (2, "")
    assert "0.6 A" in done.stderr
    shutil.copy(CONFIGS / "rigs" / "in-process.toml", tmp_path / "rig.toml")
    assert [path.name for path in tmp_path.iterdir()] == ["rig.toml"]


def test_smallest_current_limit_is_no_fault_of_the_device(tmp_path):
    limits = CLOSED.config.limits.model_copy(update={"current_max_a": 0.03})
    with Rig(CLOSED.config.model_copy(update={"limits": limits})) as rig:
        step = ManualStep(0.03, None, 20.0)
        heat(tmp_path / "small.h5", rig, step, lambda recorder, _duration_s: nullcontext(recorder.tick))
    assert read_log(tmp_path / "small.h5").ended_by == ""


def test_step_that_needs_more_than_the_largest_current_is_doubted():
    config = CLOSED.config.model_copy(update={"limits": CLOSED.config.limits.model_copy(update={"current_max_a": 0.2})})
    (caveat,) = check_step(ManualStep(None, 120.0, 1.0), config, CLOSED.data_sheet)
    assert "may stay colder" in caveat
    assert check_step(ManualStep(None, 60.0, 1.0), config, CLOSED.data_sheet) == ()
