"""A supply without a watchdog never heats without its driver, whether the driver is killed, stopped, or crashes."""

import contextlib
import os
import select
import signal
import socket
import subprocess
import sys
import threading
import time
from urllib.parse import urlsplit

import programs
import pytest
from marks import exhaustive
from process_tree import children, guardians
from supply_rig import DRIVER, RIG

from smadrive.devices.guardian.client import GuardianClient
from smadrive.devices.guardian.task import GuardedDevice, Task
from smadrive.errors import ConfigError, SafetyError, TakenOverError
from smadrive.rig.config import load_rig
from smadrive.rig.rig import Rig
from smadrive.safety.shutdown import UNCONFIRMED

SIMULATOR = [sys.executable, "-m", "firmware_sim.cli", "flexinol-lt-0.15mm"]
ASKS_AGAIN = """
import sys, time
from smadrive.rig.rig import Rig
from smadrive.rig.config import load_rig
with Rig(load_rig(sys.argv[1])) as rig:
    rig.heater.arm(1.0)
    print("heating", flush=True)
    waits = 0
    while waits < 3:
        begun_s = time.monotonic()
        assert rig.heater.exchange(0.3).armed
        waits += time.monotonic() - begun_s > 1.0
    print("heats on", flush=True)
"""
TAKES_BACK = """
import sys, time
from smadrive.errors import TakenOverError
from smadrive.rig.rig import Rig
from smadrive.rig.config import load_rig
with Rig(load_rig(sys.argv[1])) as rig:
    for said in ("heating", "heats again"):
        rig.heater.arm(1.0)
        print(said, flush=True)
        try:
            for _ in range(30):
                assert rig.heater.exchange(0.3).armed
        except TakenOverError:
            assert not rig.heater.clear_faults().armed
"""
SCRIPTED = """
import sys, smadrive
from smadrive.hysteresis import DuhemModel

class Warm:
    duration_s = float("inf")
    said = False
    def update(self, time_s, measurement, dt_s):
        if time_s > 1.0 and not self.said:
            self.said = True
            print("heating", flush=True)
        return smadrive.Command(0.2)

loop = dict(mu_heating=90, mu_cooling=69, sigma_heating=5, sigma_cooling=5, scale=12, input_range=(20, 140))
with smadrive.open_rig(sys.argv[1]) as rig:
    rig.drive(Warm(), smadrive.IdentifiedWire(DuhemModel.gaussian(**loop)), sys.argv[1] + ".h5")
"""
LOSES_REPLIES = "".join(f"[[faults]]\nat_s = {at_s}\nname = 'drop'\nreplies = 2\n" for at_s in range(20, 100, 3))


@contextlib.contextmanager
def served(profile, *options):
    """Serve a simulated device; yield its process and its address."""
    with programs.Program(
        [*SIMULATOR, "--profile", profile, *options], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        try:
            yield process, process.stdout.readline().strip()
        finally:
            process.kill()


@contextlib.contextmanager
def driven(
    tmp_path,
    fate="",
    *options,
    script=DRIVER,
    stderr=subprocess.PIPE,
    through=contextlib.nullcontext,
    watchdog_s=2.0,
    stale_after_s=1.0,
):
    """Start a driver that heats through a simulated supply; yield the processes of driver and supply.

    `through` is a context manager that turns the supply's address into that of a gateway. The guardian takes over
    after a silence of `watchdog_s`. The driver repeats a request to a silent supply within `stale_after_s`.
    """
    with (
        served("riden-rd60xx", *options) as (supply, served_url),
        served("delta-dtb") as (_, reader_url),
        through(served_url) as supply_url,
    ):
        rig = tmp_path / "rig.toml"
        text = RIG.format(supply=supply_url, reader=reader_url)
        text = text.replace("watchdog_s = 1.0", f"watchdog_s = {watchdog_s}")
        rig.write_text(text.replace("stale_after_s = 1.0", f"stale_after_s = {stale_after_s}"))
        with programs.Program(
            [sys.executable, "-c", script, str(rig), fate], stdout=subprocess.PIPE, stderr=stderr, text=True
        ) as driver:
            started = []
            try:
                assert driver.stdout.readline() == "heating\n"
                started = children(driver.pid)
                assert any(line.endswith("output on, no watchdog\n") for line in supply.stderr)
                yield driver, supply
            finally:
                driver.kill()
                while any(map(programs.lives, started)):  # the guardian needs its supply to end
                    time.sleep(0.05)


@pytest.mark.parametrize("fate", ["killed", exhaustive("stopped")])
def test_guardian_switches_off_for_a_driver_that_cannot(tmp_path, fate):
    with driven(tmp_path, fate) as (driver, supply):
        driver.send_signal(signal.SIGKILL if fate == "killed" else signal.SIGSTOP)
        assert supply.stderr.readline().endswith("output off\n")
        if fate == "stopped":
            driver.send_signal(signal.SIGCONT)
        said = driver.communicate(timeout=300)[1]
        assert "taking over" in said
        assert "heater off, confirmed by read-back" in said
        if fate == "stopped":
            assert "the guardian has taken over" in said.replace("\n", " ")


@pytest.mark.exhaustive
def test_the_guardian_switches_off_behind_the_loop_of_a_script(tmp_path):
    with driven(tmp_path, script=SCRIPTED) as (script, supply):
        (loop,) = children(script.pid)
        os.kill(loop, signal.SIGKILL)
        assert supply.stderr.readline().endswith("output off\n")
        said = script.communicate(timeout=300)[1]
        assert "LoopProcessError" in said
        assert "taking over" in said
        assert "heater off, confirmed by read-back" in said


@contextlib.contextmanager
def one_client(url):
    """Run a gateway that serves one client and lets the others wait until that client has ended; yield its address."""

    def relay(client, device):
        other = {client: device, device: client}
        while True:
            for end in select.select(list(other), (), ())[0]:
                data = end.recv(512)
                if not data:
                    return
                other[end].sendall(data)

    def serve():
        while True:
            with door.accept()[0] as client, socket.create_connection((behind.hostname, behind.port)) as device:
                if closing.is_set():
                    return
                with contextlib.suppress(ConnectionError):
                    relay(client, device)

    behind, closing = urlsplit(url), threading.Event()
    with socket.create_server(("127.0.0.1", 0)) as door:
        gateway = threading.Thread(target=serve)
        gateway.start()
        try:
            yield f"{behind.scheme}://127.0.0.1:{door.getsockname()[1]}"
        finally:
            closing.set()
            socket.create_connection(door.getsockname()).close()
            gateway.join()


@pytest.mark.exhaustive
@pytest.mark.parametrize("way_in", ["--rtu-tcp", "--tcp"])
def test_stopped_driver_with_the_only_connection_is_killed_and_its_heater_switched_off(tmp_path, way_in):
    with driven(tmp_path, "stopped", way_in, "0", through=one_client) as (driver, supply):
        driver.send_signal(signal.SIGSTOP)
        assert supply.stderr.readline().endswith("output off\n")
        said = driver.communicate(timeout=300)[1]
        assert driver.returncode == -signal.SIGKILL
        assert f"ending it (process {driver.pid})" in said
        assert said.endswith("heater off, confirmed by read-back\n")


@pytest.mark.exhaustive
def test_driver_is_not_killed_where_the_guardian_can_connect(tmp_path):
    with driven(tmp_path, "stopped", "--rtu-tcp", "0") as (driver, supply):
        driver.send_signal(signal.SIGSTOP)
        assert supply.stderr.readline().endswith("output off\n")
        driver.send_signal(signal.SIGCONT)
        said = driver.communicate(timeout=300)[1]
        assert driver.returncode == 1
        assert "ending it" not in said


@pytest.mark.exhaustive
def test_driver_that_wakes_gives_up_the_only_connection_and_is_not_killed(tmp_path):
    with driven(tmp_path, "stopped", "--rtu-tcp", "0", through=one_client) as (driver, supply):
        driver.send_signal(signal.SIGSTOP)
        assert "taking over" in driver.stderr.readline()
        driver.send_signal(signal.SIGCONT)
        assert supply.stderr.readline().endswith("output off\n")
        said = driver.communicate(timeout=300)[1]
        assert driver.returncode == 1
        assert "TakenOverError" in said
        assert "ending it" not in said


@pytest.mark.exhaustive
@pytest.mark.parametrize("fate", ["interrupted", "terminated", "crash"])
def test_driver_that_can_switch_off_needs_no_guardian(tmp_path, fate):
    with driven(tmp_path, fate) as (driver, supply):
        if fate != "crash":
            driver.send_signal(signal.SIGINT if fate == "interrupted" else signal.SIGTERM)
        assert supply.stderr.readline().endswith("output off\n")
        said = driver.communicate(timeout=300)[1]
        assert ("taking over" in said) == (fate == "terminated")  # this script does not catch SIGTERM


@pytest.mark.exhaustive
def test_guardian_watches_while_current_flows_although_the_supply_reports_off(tmp_path):
    script = tmp_path / "leaks.toml"
    script.write_text("[[faults]]\nat_s = 0.0\nname = 'short_switch'\nleak_a = 0.2\n")
    with driven(tmp_path, "crash", "--faults", str(script)) as (driver, _):
        (guardian,) = guardians(driver.pid)
        said = line = driver.stderr.readline()
        while line and "or connect the device again" not in line:
            said += (line := driver.stderr.readline())
        os.kill(guardian, signal.SIGKILL)
        said += driver.stderr.read()
    assert UNCONFIRMED in said
    assert "taking over" in said
    assert "confirmed by read-back" not in said


@pytest.mark.exhaustive
def test_stalled_terminal_does_not_keep_the_heat_on(tmp_path):
    """The terminal stalls like an ssh session or an unread pipe. Messages are lost, but the heater is switched off."""
    nobody_reads, stalled = os.pipe()
    os.set_blocking(stalled, False)
    with contextlib.suppress(BlockingIOError):
        while True:
            os.write(stalled, bytes(4096))
    os.set_blocking(stalled, True)
    try:
        with driven(tmp_path, "killed", stderr=stalled) as (driver, supply):
            driver.kill()
            assert supply.stderr.readline().endswith("output off\n")
    finally:
        os.close(nobody_reads)
        os.close(stalled)


@pytest.mark.exhaustive
def test_a_driver_whose_guardian_stands_still_switches_off(tmp_path):
    with driven(tmp_path, "unguarded") as (driver, supply):
        (guardian,) = children(driver.pid)
        os.kill(guardian, signal.SIGSTOP)
        assert supply.stderr.readline().endswith("output off\n")
        said = driver.communicate(timeout=300)[1]
        assert "SafetyError: guardian: " in said
        assert "TimeoutExpired" not in said
        assert not programs.lives(guardian)


def test_a_driver_whose_guardian_is_killed_switches_off_and_knows_that_it_is_off(tmp_path):
    with driven(tmp_path) as (driver, supply):
        (guardian,) = children(driver.pid)
        os.kill(guardian, signal.SIGKILL)
        assert supply.stderr.readline().endswith("output off\n")
        said = driver.communicate(timeout=300)[1]
        assert "SafetyError: guardian: " in said
        assert "could NOT be confirmed off" not in said


@pytest.mark.exhaustive
def test_a_driver_that_waits_for_lost_replies_is_not_taken_for_dead(tmp_path):
    script = tmp_path / "loses.toml"
    script.write_text(LOSES_REPLIES)
    waits = {"watchdog_s": 1.0, "stale_after_s": 10.0}
    with driven(tmp_path, "", "--faults", str(script), script=ASKS_AGAIN, **waits) as (driver, _):
        told, said = driver.communicate(timeout=300)
        assert driver.returncode == 0, said
        assert told == "heats on\n"
        assert "taking over" not in said


@pytest.mark.exhaustive
def test_driver_gets_its_ports_back_after_a_takeover_and_may_heat_again(tmp_path):
    with driven(tmp_path, script=TAKES_BACK) as (driver, supply):
        driver.send_signal(signal.SIGSTOP)
        assert supply.stderr.readline().endswith("output off\n")
        driver.send_signal(signal.SIGCONT)
        assert driver.stdout.readline() == "heats again\n"
        assert supply.stderr.readline().endswith("output on, no watchdog\n")
        driver.send_signal(signal.SIGSTOP)
        assert supply.stderr.readline().endswith("output off\n")
        driver.send_signal(signal.SIGCONT)
        said = driver.communicate(timeout=300)[1]
        assert driver.returncode == 0, said
        assert said.count("heater off, confirmed by read-back") == 2


def test_off_ignores_the_limits_of_heating(tmp_path):
    with served("riden-rd60xx") as (_, supply_url), served("delta-dtb") as (_, reader_url):
        rig = tmp_path / "rig.toml"
        text = RIG.format(supply=supply_url, reader=reader_url).replace("watchdog_s = 1.0", "watchdog_s = 0.6")
        rig.write_text(text.replace("temperature_max_c = 135.0", "temperature_max_c = 408.0"))
        with pytest.raises(ConfigError, match="temperature_max_c"):
            Rig(load_rig(str(rig)))
        programs.run([sys.executable, "-m", "smadrive", "off", str(rig)], check=True)


def test_driver_gives_way_to_its_guardian_and_waits_for_it():
    gave_way = []
    with served("riden-rd60xx") as (_, url):
        task = Task(GuardedDevice("riden-rd60xx", url, None), timeout_s=0.3)
        with GuardianClient(task, lambda: gave_way.append(True)) as guard:
            guard.configure({})
            guard.watch()
            time.sleep(1.0)
            for _ in range(2):
                with pytest.raises(TakenOverError):
                    guard.heartbeat()
            guard.take_back()
            assert gave_way
            guard.watch()
            guard.check()
            time.sleep(1.0)
            guard.stand_down()
            guard.watch()
            for _ in range(3):
                guard.check()
            guard.stand_down()


@pytest.mark.parametrize("name", ["select.py", "smadrive.py"])
def test_no_file_of_the_present_folder_runs_in_place_of_the_guardian(tmp_path, monkeypatch, name):
    (tmp_path / name).write_text("raise RuntimeError")
    monkeypatch.chdir(tmp_path)
    task = Task(GuardedDevice("riden-rd60xx", "serial:///dev/null", None), timeout_s=10.0)
    with GuardianClient(task, lambda: None) as guard:
        guard.configure({})
        guard.watch()
        guard.check()
        guard.stand_down()


@pytest.mark.exhaustive
def test_stopped_guardian_is_killed_at_stand_down():
    with served("riden-rd60xx") as (_, url):
        task = Task(GuardedDevice("riden-rd60xx", url, None), timeout_s=3.0)
        with GuardianClient(task, lambda: None) as guard:
            guard.configure({})
            guard.watch()
            (process,) = guardians(os.getpid())
            os.kill(process, signal.SIGSTOP)
            guard.stand_down()
            with pytest.raises(SafetyError) as error:
                guard.watch()
            assert error.value.where == "guardian"


def test_stopped_guardian_is_killed_when_the_driver_wants_its_ports_back():
    """The guardian cannot confirm the device off, because it expects another serial number."""
    with served("riden-rd60xx") as (_, url):
        task = Task(GuardedDevice("riden-rd60xx", url, None), timeout_s=60.0)
        with GuardianClient(task, lambda: None) as guard:
            guard.configure({"serial_number": 2})
            guard.watch()
            assert guard.hand_over()
            (process,) = guardians(os.getpid())
            os.kill(process, signal.SIGSTOP)
            guard.take_back()
            assert not programs.lives(process)
            guard.heartbeat()
            with pytest.raises(SafetyError) as error:
                guard.watch()
            assert error.value.where == "guardian"


@pytest.mark.exhaustive
def test_guardian_confirms_only_on_the_device_that_heated():
    with served("riden-rd60xx") as (_, url):
        task = Task(GuardedDevice("riden-rd60xx", url, None), timeout_s=0.3)
        with GuardianClient(task, lambda: None) as guard:
            guard.configure({"serial_number": 2})
            guard.watch()
            time.sleep(1.0)
            with pytest.raises(TakenOverError):
                guard.heartbeat()
            with pytest.raises(SafetyError):
                guard.take_back()
            guard.stand_down()
