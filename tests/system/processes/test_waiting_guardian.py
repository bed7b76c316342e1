"""A guardian without driver and device waits, is shown to the user, and blocks no other program."""

import contextlib
import json
import os
import signal
import subprocess
import sys
import time

import programs
import pytest
from marks import exhaustive
from process_tree import children
from served import COMMAND
from supply_rig import DRIVER, RIG, patient

from smadrive.devices.guardian.duty import waiting_duties
from smadrive.devices.guardian.search import AGREEING, PortSearch
from smadrive.devices.guardian.states import AttemptOutcome
from smadrive.devices.guardian.switch import LineAccess, OffSwitch
from smadrive.devices.guardian.task import GuardedDevice
from smadrive.devices.profile.profile import load_profile
from smadrive.devices.state.key import key_at, port_names
from smadrive.devices.state.lock import Role, lines_of, lock_line
from smadrive.files.shipped import configs_dir
from tests.conftest import RUN, guardians_of

PATIENT = "?latency_ms=2000"
"""Option of an address: a reply may be late on a busy machine."""


@pytest.fixture
def stage(tmp_path):
    with contextlib.ExitStack() as stack:
        yield Stage(tmp_path, stack)


class Stage:
    """A supply behind a port, its rig file, and a driver that heats."""

    def __init__(self, folder, stack):
        self.folder = folder
        self.stack = stack
        self.rig = folder / "rig.toml"
        self.reader = self.serve("delta-dtb", None)[1]

    def serve(self, profile, serial_number, *options):
        """Serve a simulated device with this serial number; return its process and its address."""
        sim = self.folder / f"{serial_number}.toml"
        text = (configs_dir() / "sims" / "flexinol-lt-0.15mm.toml").read_text()
        fixed = "[board]" if serial_number is None else f"[board]\nserial_number = {serial_number}"
        sim.write_text(text.replace("[board]", fixed))
        process = programs.Program(
            [*COMMAND, str(sim), "--profile", profile, *options],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        self.stack.enter_context(process)
        self.stack.callback(process.kill)
        return process, process.stdout.readline().strip()

    def heat(self, url):
        """Start a driver that heats through the supply at this address; return its process."""
        self.rig.write_text(patient(RIG.format(supply=f"{url}{PATIENT}", reader=f"{self.reader}{PATIENT}")))
        guardians = []
        self.stack.callback(
            until, lambda: not any(map(programs.lives, guardians))
        )  # the guardians need the supply to end
        driver = programs.Program(
            [sys.executable, "-c", DRIVER, str(self.rig)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        self.stack.enter_context(driver)
        self.stack.callback(driver.kill)
        assert driver.stdout.readline() == "heating\n", driver.stderr.read()
        guardians += children(driver.pid)
        return driver

    def disconnect(self, driver, supply):
        """End driver and supply at the same moment; return the waiting guardian, which ends with the test."""
        supply.terminate()
        supply.wait()
        driver.kill()
        driver.wait()
        until(waiting_duties)
        (duty,) = waiting_duties()
        self.stack.callback(end, duty.pid)
        return duty.pid

    def smadrive(self, command, *options):
        """Run a command on the rig and return the finished process."""
        arguments = [sys.executable, "-m", "smadrive", command, str(self.rig), *options]
        return programs.run(arguments, capture_output=True, text=True, check=False)


def end(pid):
    with contextlib.suppress(ProcessLookupError):
        os.kill(pid, signal.SIGKILL)


def until(happens, within_s=300.0):
    give_up_s = time.monotonic() + within_s
    while not happens():
        assert time.monotonic() < give_up_s
        time.sleep(0.05)


def events(process):
    """End a simulator and return all its events."""
    process.terminate()
    return process.communicate()[1]


@pytest.mark.parametrize("way_in", ["--pty", exhaustive("--rtu-tcp")])
@pytest.mark.exhaustive
def test_another_supply_at_the_port_is_driven_undisturbed_while_the_guardian_waits(stage, way_in):
    at = str(stage.folder / "port") if way_in == "--pty" else "0"
    supply, url = stage.serve("riden-rd60xx", 77, way_in, at)
    driver = stage.heat(url)
    guardian = stage.disconnect(driver, supply)
    at = at if way_in == "--pty" else url.rpartition(":")[2]
    other, _ = stage.serve("riden-rd60xx", 78, way_in, at)
    for _ in range(3):
        probed = stage.smadrive("probe", "--json")
        assert probed.returncode == 0, probed.stderr
        (shown,) = json.loads(probed.stdout)["waiting_guardians"]
        assert f"process {guardian}" in shown
    assert programs.lives(guardian)
    off = stage.smadrive("off", "--json")
    assert off.returncode == 4, off.stderr
    assert not json.loads(off.stdout)["safe"]
    heating = stage.heat(url)
    time.sleep(3.0)
    assert heating.poll() is None
    heating.send_signal(signal.SIGINT)
    heating.communicate()
    assert events(other).count("output on") == 1
    assert programs.lives(guardian)


@pytest.mark.exhaustive
def test_the_supply_that_heated_is_switched_off_when_it_is_back(stage):
    port = str(stage.folder / "port")
    supply, url = stage.serve("riden-rd60xx", 77, "--pty", port)
    guardian = stage.disconnect(stage.heat(url), supply)
    stage.serve("riden-rd60xx", 77, "--pty", port)
    until(lambda: not programs.lives(guardian))
    assert waiting_duties() == []


@pytest.mark.exhaustive
@pytest.mark.parametrize("command", ["probe", "off"])
def test_absent_device_is_reported_with_its_waiting_guardian(stage, command):
    supply, url = stage.serve("riden-rd60xx", 77, "--pty", str(stage.folder / "port"))
    guardian = stage.disconnect(stage.heat(url), supply)
    ended = stage.smadrive(command)
    assert ended.returncode == 3
    assert f"process {guardian}" in ended.stderr


@pytest.mark.parametrize("command", ["probe", "off"])
@pytest.mark.exhaustive
def test_program_that_confirms_the_same_supply_off_relieves_the_guardian(stage, command):
    port = str(stage.folder / "port")
    supply, url = stage.serve("riden-rd60xx", 77, "--pty", port)
    guardian = stage.disconnect(stage.heat(url), supply)
    os.kill(guardian, signal.SIGSTOP)  # otherwise the guardian would find the supply first
    again, _ = stage.serve("riden-rd60xx", 77, "--pty", port)
    ended = stage.smadrive(command, "--json")
    os.kill(guardian, signal.SIGCONT)
    if command == "off":
        assert ended.returncode == 0, ended.stderr
    until(lambda: not programs.lives(guardian))
    assert waiting_duties() == []
    assert again.poll() is None


@pytest.mark.exhaustive
def test_a_guardian_of_a_pseudo_terminal_that_is_gone_ends(stage):
    supply, url = stage.serve("riden-rd60xx", 77)
    driver = stage.heat(url)
    (guardian,) = guardians_of(os.environ[RUN])
    supply.kill()
    supply.wait()
    driver.kill()
    until(lambda: not programs.lives(guardian))
    assert waiting_duties() == []


@pytest.mark.exhaustive
def test_second_driver_on_a_network_is_rejected_and_off_stops_the_first(stage):
    supply, url = stage.serve("riden-rd60xx", 77, "--tcp", "0")
    driver = stage.heat(url)
    assert "output on" in supply.stderr.readline()
    probed = stage.smadrive("probe")
    assert probed.returncode == 3
    assert f"process {driver.pid}" in probed.stderr
    assert driver.poll() is None
    assert stage.smadrive("off").returncode == 0
    assert "output off" in supply.stderr.readline()


@pytest.mark.exhaustive
@pytest.mark.parametrize("spelled", ["localhost", "127.1", "LOCALHOST.", "[::ffff:127.0.0.1]"])
def test_second_driver_is_refused_under_another_name_of_the_host(stage, spelled):
    supply, url = stage.serve("riden-rd60xx", 77, "--tcp", "0")
    driver = stage.heat(url)
    assert "127.0.0.1" in url
    _, free_reader = stage.serve("delta-dtb", None)
    stage.rig.write_text(patient(RIG.format(supply=url.replace("127.0.0.1", spelled), reader=free_reader)))
    probed = stage.smadrive("probe")
    assert probed.returncode == 3
    assert f"process {driver.pid}" in probed.stderr
    assert driver.poll() is None
    assert supply.poll() is None


def switch_for(url, identity, search=None):
    """Return the switch of a guardian for the supply with this identity."""
    profile = load_profile("riden-rd60xx")
    device = GuardedDevice("riden-rd60xx", url, None, identity)
    return OffSwitch(device, profile, search or PortSearch(url, port_names(url), time.monotonic), LineAccess(()))


@pytest.mark.parametrize("way_in", ["--pty", *map(exhaustive, ("--rtu-tcp", "--tcp"))])
def test_attempt_does_not_use_a_line_that_another_program_holds(stage, way_in):
    _, url = stage.serve("riden-rd60xx", 77, way_in, str(stage.folder / "port") if way_in == "--pty" else "0")
    switch = switch_for(url, {"serial_number": 77})
    line = lines_of(key_at(url, load_profile("riden-rd60xx"), None))[0]
    with lock_line(line, Role.DRIVER):
        assert switch.off(alone=True).outcome is AttemptOutcome.BUSY
        assert switch.off(alone=False).outcome is AttemptOutcome.CONFIRMED  # the driver shares its line
    assert switch.off(alone=True).outcome is AttemptOutcome.CONFIRMED


def test_attempt_does_not_try_a_port_with_another_device_for_a_while(stage):
    _, url = stage.serve("riden-rd60xx", 78)
    search = PortSearch(url, port_names(url), lambda: 0.0)
    switch = switch_for(url, {"serial_number": 77}, search)
    outcomes = [switch.off(alone=True).outcome for _ in range(AGREEING)]
    assert outcomes == [AttemptOutcome.ANOTHER_DEVICE] * AGREEING
    assert search.urls() == []
    assert switch.off(alone=True).outcome is AttemptOutcome.UNREACHABLE
