"""`smadrive board calibrate` corrects a board once per log, and rejects what it cannot use before it opens a port."""

import json
import sys
from contextlib import nullcontext

import programs
import pytest
from served import SIM, served

from firmware_sim.bench import simulated_device
from firmware_sim.config import load_sim
from smadrive.cli.board import BoardAction, main
from smadrive.clock import VirtualClock
from smadrive.control.controllers.step import ManualStep
from smadrive.errors import ConfigError, DataError
from smadrive.files.shipped import configs_dir
from smadrive.rig.config import load_rig
from smadrive.rig.controllers import step_controller
from smadrive.rig.rig import Rig
from smadrive.runs.experiments import heat
from smadrive.runs.run_log import record_step

SERIAL_NUMBER, CURRENT_A = 7, 0.2
STEP = ManualStep(CURRENT_A, None, 5.0)


@pytest.fixture
def open_rig():
    """A rig with a board of the serial number `SERIAL_NUMBER`, in virtual time."""
    sim = load_sim(SIM)
    board = sim.board.model_copy(update={"serial_number": SERIAL_NUMBER})
    device, clock = simulated_device(sim.model_copy(update={"board": board}), seed=3), VirtualClock()
    clock.follow(device.bench.advance_to)
    with Rig(load_rig("in-process"), transports={"board": device.transport(clock)}) as rig:
        yield rig


@pytest.fixture
def log_file(open_rig, tmp_path):
    heat(tmp_path / "held.h5", open_rig, STEP, lambda recorder, _duration_s: nullcontext(recorder.tick))
    return tmp_path / "held.h5"


@pytest.fixture
def served_port(tmp_path):
    """Return the context manager that serves a board with a serial number, and yields its port."""

    def serve(serial_number):
        sim = tmp_path / f"{serial_number}.toml"
        text = (configs_dir() / "sims" / f"{SIM}.toml").read_text()
        sim.write_text(text.replace("[board]\n", f"[board]\nserial_number = {serial_number}\n"))
        return served(sim=str(sim))

    return serve


def calibrate(url, log_file):
    main(BoardAction.CALIBRATE, url.removeprefix("serial://"), log_file, 0.19, 3.2, as_json=True)


def test_second_calibration_with_the_same_log_changes_nothing(served_port, log_file, capsys):
    with served_port(SERIAL_NUMBER) as (_, url):
        calibrate(url, log_file)
        first = json.loads(capsys.readouterr().out)
        calibrate(url, log_file)
        again = json.loads(capsys.readouterr().out)
    assert first["source_gain"] == pytest.approx(CURRENT_A / 0.19, rel=0.01)
    assert again == first


def test_log_of_another_board_is_refused(served_port, log_file):
    with served_port(SERIAL_NUMBER + 1) as (_, url), pytest.raises(ConfigError) as refused:
        calibrate(url, log_file)
    assert (refused.value.where, refused.value.limit) == ("--log", str(SERIAL_NUMBER))


def test_log_without_the_constants_of_the_board_is_refused(open_rig, tmp_path):
    log_file = tmp_path / "old.h5"
    controller = step_controller(open_rig.config, STEP, open_rig.nominal_balance)
    with record_step(log_file, open_rig, STEP) as recorder:
        open_rig.drive(controller, open_rig.nominal_balance, recorder.tick)
    with pytest.raises(DataError) as refused:
        calibrate("/dev/null", log_file)
    assert refused.value.where == str(log_file)


@pytest.mark.parametrize(
    "arguments",
    [
        ("calibrate", "/dev/null", "--current", "0.3", "--voltage", "5"),
        ("calibrate", "/dev/null", "--log", "none.h5", "--current", "0.3", "--voltage", "5"),
        ("check", "/dev/null", "--current", "0.3"),
    ],
    ids=["no log", "log that does not exist", "option of another action"],
)
def test_wrong_options_end_with_a_sentence(arguments, tmp_path):
    command = [sys.executable, "-m", "smadrive", "board", *arguments]
    done = programs.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert "Traceback" not in done.stderr
