"""`smadrive off` while a driver runs: the driver ends, and the heater is confirmed off, in real time."""

import json
import os
import signal
import subprocess
import sys
import tomllib
from contextlib import suppress

import programs
import pytest
from marks import exhaustive
from process_tree import children
from served import PATIENT, served
from supply_rig import DRIVER, RIG, patient

from smadrive.errors import STOPPED
from smadrive.files.shipped import configs_dir
from smadrive.hysteresis import DuhemModel, save_model
from smadrive.runs.log.reader import STOP, read_log
from smadrive.safety.shutdown import CONFIRMED

HEATS = """
import sys, threading, time
from smadrive.errors import StoppedError
from smadrive.rig.rig import Rig
from smadrive.rig.config import load_rig
def heat():
    with Rig(load_rig(sys.argv[1])) as rig:
        rig.heater.arm(rig.config.limits.watchdog_s)
        print("heating", flush=True)
        while True:
            rig.heater.exchange(0.3)
            time.sleep(0.05)
"""
TRIES_AGAIN = f"""{HEATS}
while True:
    try:
        heat()
    except Exception as error:
        print(type(error).__name__, flush=True)
"""
IN_A_THREAD = f"""{HEATS}
def drive():
    try:
        heat()
    except StoppedError as stopped:
        print(stopped, flush=True)
thread = threading.Thread(target=drive)
thread.start()
thread.join()
"""
SCRIPT = """
import math, sys
import smadrive
class Warm:
    duration_s = math.inf
    def update(self, time_s, measurement, dt_s):
        return smadrive.Command(0.3)
try:
    with smadrive.open_rig(sys.argv[1]) as rig:
        print("open", flush=True)
        rig.drive(Warm(), smadrive.load_wire("wire.json"))
except BaseException as error:
    print(type(error).__name__, error, *getattr(error, "__notes__", ()), sep="\\n", flush=True)
"""
IDLE_SCRIPT = """
import sys
import smadrive
rig = smadrive.open_rig(sys.argv[1])
print("open", flush=True)
sys.stdin.readline()
while not rig._client.is_lost:
    pass
print(rig)
for request in (rig.measure, rig.close):
    try:
        request()
    except BaseException as error:
        print(type(error).__name__, error, flush=True)
"""
SWITCHED_ON = {"board": "armed", "supply": "output on"}
SWITCHED_OFF = {"board": ("disarmed", "heater off"), "supply": ("output off",)}
WIRE = DuhemModel.gaussian(
    mu_heating=89.9, mu_cooling=69, sigma_heating=5, sigma_cooling=5, scale=12, input_range=(20, 130)
)


class Heated:
    """A served board or supply, and the rig file for it."""

    def __init__(self, kind, source, rig):
        self.kind, self.source, self.rig = kind, source, rig

    def drive(self, manner="runs"):
        """A driver that heats."""
        return self.start("-c", DRIVER, str(self.rig), manner)

    def start(self, *arguments, **options):
        """A program that heats or is going to heat; it is killed at the end of its block."""
        return programs.Program(
            [sys.executable, *arguments],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            cwd=self.rig.parent,
            **options,
        )

    def is_switched_on(self):
        return SWITCHED_ON[self.kind] in self.source.stderr.readline()

    def is_switched_off(self):
        line = self.source.stderr.readline()
        return any(text in line for text in SWITCHED_OFF[self.kind])

    def off(self):
        """The result of `smadrive off`, which succeeds."""
        done = programs.run(self._off(), capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        return json.loads(done.stdout)

    def begin_off(self):
        """`smadrive off`, not awaited."""
        return programs.Program(self._off(), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)

    def _off(self):
        return [sys.executable, "-m", "smadrive", "off", str(self.rig), "--json"]


@pytest.fixture(params=["board", exhaustive("supply")])
def heated(request, tmp_path):
    if request.param == "board":
        with served("--pty", str(tmp_path / "port")) as (process, url):
            text = (configs_dir() / "rigs" / "simulated.toml").read_text()
            text = text.replace(tomllib.loads(text)["devices"][0]["url"], url + PATIENT)
            assert "watchdog_s = 0.5 " in text
            text = text.replace("watchdog_s = 0.5 ", "watchdog_s = 5.0 ")  # a busy machine may delay an exchange
            (tmp_path / "rig.toml").write_text(text)
            yield Heated("board", process, tmp_path / "rig.toml")
        return
    with (
        served("--profile", "riden-rd60xx", "--rtu-tcp", "0") as (process, url),
        served("--profile", "delta-dtb") as (_, reader_url),
    ):
        text = patient(RIG.format(supply=url + PATIENT, reader=reader_url + PATIENT))
        (tmp_path / "rig.toml").write_text(text)
        yield Heated("supply", process, tmp_path / "rig.toml")


@pytest.mark.parametrize("heated", ["board", exhaustive("supply")], indirect=True)
def test_running_driver_is_stopped(heated):
    with heated.drive() as driver:
        assert driver.stdout.readline() == "heating\n"
        assert heated.is_switched_on()
        done = heated.off()
        assert heated.is_switched_off()
        said = driver.communicate()[1]
    assert "StoppedError" in said
    assert done["stopped_drivers"] == [{"pid": driver.pid, "killed": False}]
    assert (done["safe"], done["faults"]) == (True, [])


@pytest.mark.exhaustive
@pytest.mark.parametrize("profile", ["autonics-tk", None], ids=["heats nothing", "another source"])
def test_failed_off_names_the_driver_that_it_stopped(heated, profile):
    right, other = ("sma-reference", "riden-rd60xx")[:: 1 if heated.kind == "board" else -1]
    with heated.drive() as driver:
        assert driver.stdout.readline() == "heating\n"
        heated.rig.write_text(heated.rig.read_text().replace(right, profile or other))
        with heated.begin_off() as off:
            assert f"process {driver.pid}" in off.communicate()[1]
        assert off.returncode in (2, 3)
        assert driver.wait() != 0


@pytest.mark.exhaustive
@pytest.mark.parametrize("manner", ["stopped", "hangs"])
def test_driver_that_does_not_answer_is_ended_and_the_heater_is_off(heated, manner):
    with heated.drive(manner) as driver:
        assert driver.stdout.readline() == "heating\n"
        assert heated.is_switched_on()
        if manner == "stopped":
            driver.send_signal(signal.SIGSTOP)
        done = heated.off()
        assert heated.is_switched_off()
        assert driver.wait() != 0
    assert [stopped["pid"] for stopped in done["stopped_drivers"]] == [driver.pid]
    assert done["safe"]
    assert done["waiting_guardians"] == []


def test_two_requests_at_once_both_confirm_the_heater_off(heated):
    with heated.drive() as driver:
        assert driver.stdout.readline() == "heating\n"
        both = heated.begin_off(), heated.begin_off()
        for off in both:
            with off:
                stdout, stderr = off.communicate()
                assert off.returncode == 0, stderr
                assert json.loads(stdout)["safe"]
        driver.communicate()


@pytest.mark.parametrize("heated", ["board"], indirect=True)
@pytest.mark.parametrize(
    "arguments",
    [
        ("excite", "rig.toml", "-o", "log.h5"),
        exhaustive(("tune", "rig.toml", "--model", "wire.json", "--port", "0", "--no-browser")),
    ],
    ids=lambda arguments: arguments[0],
)
def test_command_that_is_stopped_ends_with_the_code_of_safety_and_latches_no_trip(heated, arguments):
    save_model(WIRE, heated.rig.parent / "wire.json")
    with heated.start("-m", "smadrive", *arguments) as driver:
        if arguments[0] == "excite":
            assert heated.is_switched_on()
        else:
            assert driver.stdout.readline()
        done = heated.off()
        said = driver.communicate()[1]
    assert driver.returncode == 4, said
    assert "stopped by `smadrive off`" in said
    assert "confirmed by read-back" in said
    (log,) = heated.rig.parent.glob("*.h5")
    assert read_log(log).ended_by == f"{STOP}: `smadrive off`"
    assert (done["stopped_drivers"], done["faults"]) == ([{"pid": driver.pid, "killed": False}], [])


@pytest.mark.exhaustive
@pytest.mark.parametrize("heated", ["board"], indirect=True)
@pytest.mark.parametrize("command", [("tune", "--model", "wire.json"), ("watch", "--page")], ids=["tune", "watch"])
def test_pages_that_hang_do_not_hold_the_line(heated, command):
    save_model(WIRE, heated.rig.parent / "wire.json")
    name, *options = command
    with heated.start("-m", "smadrive", name, "rig.toml", *options, "--port", "0", "--no-browser") as driver:
        while "http://" not in driver.stdout.readline():
            pass
        hung = children(driver.pid)
        for child in hung:
            os.kill(child, signal.SIGSTOP)
        try:
            done = heated.off()
            assert driver.wait() > 0
        finally:
            for child in hung:
                with suppress(ProcessLookupError):
                    os.kill(child, signal.SIGCONT)
    assert done["stopped_drivers"] == [{"pid": driver.pid, "killed": False}]


@pytest.mark.parametrize("code", [TRIES_AGAIN, exhaustive(IN_A_THREAD)], ids=["tries again", "in a thread"])
def test_program_that_is_stopped_does_not_heat_again(heated, code):
    with heated.start("-c", code, str(heated.rig)) as driver:
        assert driver.stdout.readline() == "heating\n"
        done = heated.off()
        printed, said = driver.communicate()
    assert "stopped by `smadrive off`" in printed + said
    assert "heating" not in printed
    assert done["stopped_drivers"] == [{"pid": driver.pid, "killed": False}]


@pytest.mark.parametrize("heated", ["board"], indirect=True)
def test_script_on_an_open_rig_is_stopped(heated):
    save_model(WIRE, heated.rig.parent / "wire.json")
    with heated.start("-c", SCRIPT, str(heated.rig)) as script:
        assert script.stdout.readline() == "open\n"
        assert heated.is_switched_on()
        done = heated.off()
        printed, said = script.communicate()
    kind, text, *notes = printed.splitlines()
    assert kind == "StoppedError", said
    assert CONFIRMED in text
    assert [note.partition(":")[0] for note in notes] == ["the record of the run up to its end"]
    assert not any(stopped["killed"] for stopped in done["stopped_drivers"])
    log = read_log(heated.rig.parent / "run.h5")
    assert (log.ended_by, log.is_ended_by_user) == (f"{STOP}: `smadrive off`", True)


@pytest.mark.exhaustive
@pytest.mark.parametrize("heated", ["board"], indirect=True)
def test_idle_script_knows_that_it_was_stopped(heated):
    with heated.start("-c", IDLE_SCRIPT, str(heated.rig), stdin=subprocess.PIPE) as script:
        assert script.stdout.readline() == "open\n"
        heated.off()
        printed, said = script.communicate("\n")
    assert said == ""
    shown, *errors = printed.splitlines()
    assert f"{STOPPED} `smadrive off`" in shown
    assert [error.partition(" ")[0] for error in errors] == ["StoppedError"]
    assert CONFIRMED in errors[0]


@pytest.mark.exhaustive
def test_driver_is_stopped_although_its_link_leads_to_another_device(tmp_path):
    """As when an adapter is plugged in again, and another one gets the link of a udev rule."""
    text = (configs_dir() / "rigs" / "simulated.toml").read_text()
    link = tmp_path / "link"
    rig = text.replace(tomllib.loads(text)["devices"][0]["url"], f"serial://{link}{PATIENT}")
    (tmp_path / "rig.toml").write_text(rig)
    with served() as (first, first_url), served() as (_, second_url):
        link.symlink_to(first_url.removeprefix("serial://").partition("?")[0])
        heated = Heated("board", first, tmp_path / "rig.toml")
        with heated.drive() as driver:
            assert driver.stdout.readline() == "heating\n"
            assert heated.is_switched_on()
            link.unlink()
            link.symlink_to(second_url.removeprefix("serial://").partition("?")[0])
            done = heated.off()
            assert heated.is_switched_off()
            driver.communicate()
    assert [stopped["pid"] for stopped in done["stopped_drivers"]] == [driver.pid]


MISTAKES = {
    "profile": lambda text, _url: text.replace('"sma-reference"', '"sma-refrence"'),
    "profile without its file": lambda text, _url: text.replace('"sma-reference"', '"devices/mine.toml"'),
    "header": lambda text, _url: text.replace("[[devices]]", "[devices]"),
    "key of the address": lambda text, url: text.replace(f'url = "{url}', f'port = "{url}'),
    "quotes": lambda text, url: text.replace(f'"{url}{PATIENT}"', url),
    "scheme": lambda text, url: text.replace(url, url.removeprefix("serial://")),
    "nothing can be parsed": lambda text, _url: text + "[[[\n" * 100,
}


@pytest.mark.parametrize("heated", ["board"], indirect=True)
@pytest.mark.parametrize("mistake", ["profile", *map(exhaustive, list(MISTAKES)[1:])])
def test_mistake_in_the_devices_does_not_keep_a_driver_running(heated, mistake, tmp_path):
    text = heated.rig.read_text()
    url = tomllib.loads(text)["devices"][0]["url"].partition("?")[0]
    wrong = tmp_path / "wrong.toml"
    wrong.write_text(MISTAKES[mistake](text, url))
    assert wrong.read_text() != text
    with heated.drive() as driver:
        assert driver.stdout.readline() == "heating\n"
        assert heated.is_switched_on()
        off = [sys.executable, "-m", "smadrive", "off", str(wrong)]
        done = programs.run(off, capture_output=True, text=True, check=False)
        assert done.returncode == 2
        assert f"process {driver.pid}" in done.stdout + done.stderr
        assert heated.is_switched_off()
        driver.communicate()
