"""Switching off with a wrong rig file, without sensors and without the port. A failure is reported as a failure."""

import json
import os
import signal
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path
from urllib.parse import quote

import programs
import pytest
from marks import exhaustive
from served import PATIENT, served

from smadrive.devices.device import Device
from smadrive.devices.profile.profile import load_profile
from smadrive.files.shipped import configs_dir
from smadrive.modbus.client import ModbusClient
from smadrive.modbus.transports.connect import open_transport

UNCONFIRMED = "the heater could NOT be confirmed off"
SHIPPED = (configs_dir() / "rigs" / "bench-supply.toml").read_text().replace("/dev/ttyUSB", "/dev/no-such-port-")
SUPPLY_URL = "serial:///dev/no-such-port-0"


def off(rig, *options):
    """Run `smadrive off` and return the finished process."""
    command = [sys.executable, "-m", "smadrive", "off", str(rig), *options]
    return programs.run(command, capture_output=True, text=True, check=False)


@pytest.fixture
def hot(tmp_path):
    """Yield a heating supply without driver and guardian: its process, a rig file without sensors, its port."""
    with served("--profile", "riden-rd60xx") as (process, url):
        profile = load_profile("riden-rd60xx")
        with open_transport(url + PATIENT, profile.serial_settings()) as port:
            supply = Device(profile, ModbusClient(port))
            for name, value in (("v_set", 5.0), ("i_set", 0.3), ("output", 1)):
                supply.write(name, value)
        assert "output on" in process.stderr.readline()
        rig = tmp_path / "rig.toml"
        rig.write_text(SHIPPED.replace(SUPPLY_URL, url))
        yield process, rig, Path(url.removeprefix("serial://"))


def is_off(process):
    """Return True if the next line of the supply says that its output is off."""
    return "output off" in process.stderr.readline()


def test_heater_is_off_before_a_missing_sensor_is_reported(hot):
    process, rig, _ = hot
    done = off(rig, "--json")
    assert is_off(process)
    told = json.loads(done.stdout)
    assert (told["safe"], told["devices"]) == (False, ["supply"])
    assert "no such port" in told["failure"]
    assert done.returncode == 3
    assert "no such port" in done.stderr
    assert UNCONFIRMED not in done.stderr


@pytest.mark.parametrize(
    ("right", "wrong"),
    [
        exhaustive('wire = "', 'wire = "no-'),
        exhaustive("temperature_max_c = ", "temperature_max = "),
        exhaustive("rate_hz = ", "rate_hz = -"),
        exhaustive("high_c = ", "high_c = 9"),
        exhaustive("rate_hz = ", "rate_hz = 2,"),
        ("[limits]", "[limits"),
    ],
)
def test_off_ignores_other_errors_of_the_rig_file(hot, right, wrong):
    process, rig, _ = hot
    text = rig.read_text()
    assert right in text
    rig.write_text(text.replace(right, wrong))
    done = off(rig)
    assert "heater off, confirmed by read-back (supply)" in done.stdout
    assert done.returncode == 3  # the bead of this rig has no port
    assert is_off(process)


@pytest.mark.exhaustive
@pytest.mark.parametrize(("right", "wrong"), [('url = "', "url = "), ("[[devices]]", "[[devices")])
def test_off_switches_off_a_device_with_a_correctable_address_and_reports_the_mistake(hot, right, wrong):
    process, rig, _ = hot
    text = rig.read_text()
    assert right in text
    rig.write_text(text.replace(right, wrong))
    done = off(rig)
    assert "heater off, confirmed by read-back (supply)" in done.stdout
    assert done.returncode == 2
    assert f"{rig}, line" in done.stderr or "not valid TOML" in done.stderr
    assert is_off(process)


@pytest.mark.exhaustive
@pytest.mark.parametrize(
    "url", ["tcp://[::1", "tcp://192.168.1..10:502", r"serial:///dev/tty\u0000", "sim://a\\u0000b.toml"]
)
def test_bad_address_of_one_device_does_not_keep_the_others_on(hot, url):
    process, rig, _ = hot
    other = f'[[devices]]\nname = "other"\nprofile = "riden-rd60xx"\nurl = "{url}"\n'
    rig.write_text(rig.read_text().replace("\n[[devices]]", f"\n{other}\n[[devices]]", 1))
    done = off(rig)
    assert done.returncode == 2, done.stderr
    assert is_off(process)
    assert UNCONFIRMED in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize(
    ("text", "code"),
    [
        (SHIPPED, 3),
        (SHIPPED.replace("riden-rd60xx", "riden-rd99"), 2),
        (SHIPPED.replace("url = ", "url "), 2),
        ("", 2),
        (SHIPPED.replace("riden-rd60xx", "delta-dtb"), 2),
        (None, 2),
    ],
    ids=["no port", "no profile", "no TOML", "empty", "nothing heats", "no file"],
)
def test_failed_off_does_not_report_the_heater_off(tmp_path, text, code):
    rig = tmp_path / "rig.toml"
    if text is not None:
        rig.write_text(text)
    done = off(rig)
    assert done.returncode == code, done.stderr
    assert UNCONFIRMED in done.stderr
    assert "cut its supply" in done.stderr
    assert "Traceback" not in done.stderr
    assert not done.stdout


def test_controller_that_could_heat_enters_its_safe_state_without_the_supply(tmp_path):
    profile = load_profile("delta-dtb")
    with served("--profile", "delta-dtb") as (_, url), open_transport(url + PATIENT, profile.serial_settings()) as port:
        controller, step = Device(profile, ModbusClient(port)), profile.safe_state[0]
        controller.write(step.register_, 1 - step.value)
        port.disconnect()
        rig = tmp_path / "rig.toml"
        rig.write_text(
            SHIPPED.replace("autonics-tk", "delta-dtb").replace(SUPPLY_URL[:-1] + "1", url).partition("[limits]")[0]
        )
        done = off(rig)
        assert done.returncode == 3
        assert UNCONFIRMED in done.stderr
        assert controller.read((step.register_,))[step.register_].value == step.value


def test_unreadable_state_folder_does_not_undo_a_confirmed_off(hot, tmp_path, monkeypatch):
    process, rig, _ = hot
    rig.write_text(supply_alone(rig.read_text()))
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / ("x" * 300)))
    done = off(rig, "--json")
    assert (done.returncode, done.stderr) == (0, "")
    assert is_off(process)
    told = json.loads(done.stdout)
    assert (told["safe"], told["failure"]) == (True, None)
    assert told["warnings"]
    assert told["faults"]


def supply_alone(text):
    """Return the rig file with only its first device, which heats."""
    devices, limits, rest = text.partition("[limits]")
    head, first, *_ = devices.split("\n[[devices]]\n")
    return f"{head}\n[[devices]]\n{first}{limits}{rest}"


@pytest.mark.exhaustive
@pytest.mark.parametrize("folder", ["guardians", "locks"])
def test_pipe_in_the_state_folder_does_not_keep_off_waiting(hot, state_home, folder):
    process, rig, port = hot
    (state_home / "smadrive" / folder).mkdir(parents=True)
    names = {"guardians": "aa.json", "locks": quote(f"serial://{port.resolve()}", safe="")}
    os.mkfifo(state_home / "smadrive" / folder / names[folder])
    done = off(rig)
    assert done.returncode == 3, done.stderr  # because the sensors of the rig are missing
    assert is_off(process)


@contextmanager
def switching_off_in_silence(hot):
    """Start `smadrive off` on a silent supply; yield the process after it has opened the port."""
    process, rig, port = hot
    process.send_signal(signal.SIGSTOP)
    with programs.Program(
        [sys.executable, "-m", "smadrive", "off", str(rig)], stderr=subprocess.PIPE, text=True
    ) as switching:
        while str(port) not in programs.open_files(switching.pid):
            time.sleep(0.02)
        yield switching


def test_off_interrupted_three_times_does_not_report_the_heater_off(hot):
    process, rig, _ = hot
    with switching_off_in_silence(hot) as switching:
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            switching.send_signal(number)
        _, told = switching.communicate()
    assert switching.returncode == 130
    assert "interrupted" in told
    assert UNCONFIRMED in told
    process.send_signal(signal.SIGCONT)
    assert off(rig).returncode == 3
    assert is_off(process)


@pytest.mark.parametrize("number", [exhaustive(signal.SIGINT), signal.SIGHUP])
def test_a_signal_does_not_keep_it_from_switching_off_a_supply_that_answers_again(hot, number):
    process, _, _ = hot
    with switching_off_in_silence(hot) as switching:
        switching.send_signal(number)
        process.send_signal(signal.SIGCONT)
        _, told = switching.communicate()
    assert is_off(process)
    assert switching.returncode == 3  # because the sensors of the rig are missing
    assert UNCONFIRMED not in told


def test_simulated_device_of_another_program_is_named_as_not_stopped():
    done = off("in-process")
    assert done.returncode == 0
    assert "confirmed by read-back (board, simulated by this command)" in done.stdout
    assert "warning: each program simulates 'board' (sim://) for itself" in done.stdout
    done = json.loads(off("in-process", "--json").stdout)
    assert (done["simulated"], done["stopped_drivers"], len(done["warnings"])) == (["board"], [], 1)


BOARD = """
name = "board"
[[devices]]
name = "board"
profile = "sma-reference"
url = "{url}"
[limits]
current_max_a = 0.6
"""


@pytest.mark.parametrize(("lasts", "cleared"), [("", 4), ("for_s = 0.1\n", 0)])
def test_board_with_silent_meters_is_not_confirmed_off_until_the_fault_is_cleared(tmp_path, lasts, cleared):
    (tmp_path / "faults.toml").write_text(f'[[faults]]\nat_s = 0.0\nname = "silence_sensor_bus"\n{lasts}')
    rig = tmp_path / "rig.toml"
    with served("--faults", str(tmp_path / "faults.toml")) as (_, url):
        rig.write_text(BOARD.format(url=url))
        plain, clearing = off(rig), off(rig, "--clear-faults")
    assert plain.returncode == 4
    assert UNCONFIRMED in plain.stderr
    assert "confirmed by read-back" not in plain.stdout
    assert clearing.returncode == cleared, clearing.stderr
    assert ("confirmed by read-back" in clearing.stdout) is (cleared == 0)


def test_off_that_confirms_nothing_prints_the_reason_as_json(tmp_path):
    rig = tmp_path / "rig.toml"
    rig.write_text(SHIPPED)
    done = off(rig, "--json")
    told = json.loads(done.stdout)
    assert (told["safe"], told["devices"], told["stopped_drivers"]) == (False, [], [])
    assert told["failure"] in done.stderr
    assert done.returncode == 3


def test_fault_that_persists_does_not_hide_that_the_heater_is_off(tmp_path):
    (tmp_path / "faults.toml").write_text('[[faults]]\nat_s = 0.0\nname = "open_thermocouple"\n')
    rig = tmp_path / "rig.toml"
    with served("--faults", str(tmp_path / "faults.toml")) as (_, url):
        rig.write_text(BOARD.format(url=url))
        done = off(rig, "--clear-faults", "--json")
    told = json.loads(done.stdout)
    assert (told["safe"], told["devices"], told["faults"]) == (True, ["board"], ["thermocouple_open"])
    assert told["failure"] in done.stderr
    assert done.returncode == 4
    assert UNCONFIRMED not in done.stderr
