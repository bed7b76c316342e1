"""firmware-sim as a process on a pseudo-terminal: with the driver, a third-party client, and killed clients."""

import contextlib
import re
import shutil
import signal
import subprocess
import sys

import programs
import pytest
from served import COMMAND, PATIENT, SIM, advance, served

from smadrive.clock import MonotonicClock
from smadrive.devices.device import Device
from smadrive.devices.heater import Heater
from smadrive.devices.heating.board import HeaterBoard
from smadrive.devices.heating.heat_source import HeaterLimits
from smadrive.devices.profile.profile import load_profile
from smadrive.modbus import requests
from smadrive.modbus.client import ModbusClient
from smadrive.modbus.framing import rtu
from smadrive.modbus.transports.connect import open_transport

PROFILE = load_profile("sma-reference")
LIMITS = HeaterLimits(current_max_a=0.6, temperature_max_c=130.0)


@contextlib.contextmanager
def connected(url):
    with open_transport(url + PATIENT, PROFILE.serial_settings()) as transport:
        yield Device(PROFILE, ModbusClient(transport))


def finish(process, signum):
    process.send_signal(signum)
    return process.wait(300)


def test_driver_heats_over_a_real_port(tmp_path):
    link = tmp_path / "wire"
    with served("--pty", str(link)) as (process, url):
        assert url == f"serial://{link}"
        with connected(url) as device:
            board = Heater(HeaterBoard(device, MonotonicClock()), LIMITS, MonotonicClock())
            board.connect()
            board.arm(5.0)
            board.exchange(0.4)
            assert board.exchange(0.4).armed
            board.enter_safe_state()
        assert finish(process, signal.SIGTERM) == 0
        assert not link.is_symlink()
        log = process.stderr.read()
    assert [line.split(" s ")[1] for line in log.splitlines()] == [
        "armed, watchdog 5.000 s",
        "disarmed",
        "heater off, end",
    ]


@pytest.mark.skipif(shutil.which("mbpoll") is None, reason="needs mbpoll (Debian package mbpoll)")
def test_third_party_client_reads_the_same_words_as_the_driver():
    names = ("device_id", "map_version", "firmware_version", "serial_number", "watchdog_s", "temperature_max")
    with served("--time", "lockstep") as (process, url):
        with connected(url) as device:
            ours = device.read((*names, "temperature", "cold_junction", "sample_counter", "uptime"))
        port = url.removeprefix("serial://")
        words = {}
        for first, count in ((0, 5), (16, 13), (48, 3)):
            words |= mbpoll(port, "-r", str(first), "-c", str(count))
        rejected = subprocess.run(
            ["mbpoll", "-m", "rtu", "-b115200", "-Pnone", "-a1", "-0", "-r5", "-1", port],
            capture_output=True,
            check=False,
        )
        assert finish(process, signal.SIGINT) == 0
    for name, reading in ours.items():
        register = PROFILE.register(name)
        assert register.codec.decode([words[address] for address in register.addresses]) == reading
    assert b"Illegal data address" in rejected.stderr


def mbpoll(port, *options):
    command = ["mbpoll", "-m", "rtu", "-b115200", "-Pnone", "-a1", "-0", "-1", *options, port]
    output = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    return {int(at): int(word) for at, word in re.findall(r"\[(\d+)\]:\s+(\d+)", output)}


CLIENT = """
import sys
from smadrive.clock import MonotonicClock
from smadrive.devices.device import Device
from smadrive.devices.heating.board import HeaterBoard
from smadrive.devices.heater import Heater
from smadrive.devices.heating.heat_source import HeaterLimits
from smadrive.devices.profile.profile import load_profile
from smadrive.modbus.client import ModbusClient
from smadrive.modbus import requests
from smadrive.modbus.framing import rtu
from smadrive.modbus.transports.connect import open_transport

device = Device(load_profile("sma-reference"), ModbusClient(open_transport(sys.argv[1])))
clock = MonotonicClock()
board = Heater(HeaterBoard(device, clock), HeaterLimits(current_max_a=0.6, temperature_max_c=130.0), clock)
board.connect()
board.arm(0.3)
board.exchange(0.3)
print("heating", flush=True)
while True:
    board.exchange(0.3)
"""


def test_heater_goes_off_when_the_client_is_killed():
    with served() as (process, url):
        command = [sys.executable, "-c", CLIENT, url + PATIENT]
        with programs.Program(command, stdout=subprocess.PIPE, text=True) as client:
            assert client.stdout.readline() == "heating\n"
            client.kill()
        log = [process.stderr.readline(), process.stderr.readline()]
        assert log[0].endswith("armed, watchdog 0.300 s\n")
        assert log[1].endswith("watchdog: no new sequence for 0.300 s, heater off\n")
        with connected(url) as device:
            board = Heater(HeaterBoard(device, MonotonicClock()), LIMITS, MonotonicClock())
            found = board.connect()
            assert found.device_faults == ("watchdog",)
            assert found.current_a < 0.01
            board.clear_faults()
        assert finish(process, signal.SIGTERM) == 0


def test_lockstep_time_stands_still_between_lines_and_is_repeatable():
    def heated():
        with served("--time", "lockstep", "--seed", "7") as (process, url), connected(url) as device:
            board = Heater(HeaterBoard(device, MonotonicClock()), LIMITS, MonotonicClock())
            board.connect()
            board.arm(0.5)
            measured_values = []
            for tick in range(1, 41):
                advance(process, tick * 0.05)
                measured = board.exchange(0.3)
                measured_values.append((measured.temperature_c, measured.current_a, measured.displacement_mm))
            uptime_s = device.read(("uptime",))["uptime"].value
            process.stdin.close()
            assert process.wait(300) == 0
            assert "t=2.000 s heater off, end" in process.stderr.read()
            return uptime_s, measured_values

    first, second = heated(), heated()
    assert first == second
    assert first[0] == pytest.approx(2.0)
    assert first[1][-1][0] > 60.0


@pytest.mark.parametrize("option", ["--pty", "--rtu-tcp"])
def test_reply_on_a_slow_line_arrives_after_the_time_of_its_characters(option, tmp_path):
    address = str(tmp_path / "port") if option == "--pty" else "0"
    with served("--profile", "delta-dtb", "--line-speed", "--time", "lockstep", option, address) as (process, url):
        request = rtu.seal(1, requests.read_holding(0x1000, 2).pdu)
        reply_s = (8 + 9) * 10 / 9600 + 3.5 * 11 / 9600
        with open_transport(url + PATIENT, load_profile("delta-dtb").serial_settings()) as transport:
            advance(process, 1.0)
            transport.write(request)
            assert transport.read(transport.clock.now_s() + 0.3) == b""
            advance(process, 1.0 + 0.9 * reply_s)
            assert transport.read(transport.clock.now_s()) == b""
            advance(process, 1.0 + 1.1 * reply_s)
            assert len(transport.read(transport.clock.now_s() + 5.0)) == 9


@pytest.mark.parametrize("options", [(), ("--log", "/dev/full")], ids=["closed pipe", "full disk"])
def test_events_that_cannot_be_written_do_not_end_the_devices(options):
    with served("--time", "lockstep", *options) as (process, url), connected(url) as device:
        if not options:
            process.stderr.close()
        board = Heater(HeaterBoard(device, MonotonicClock()), LIMITS, MonotonicClock())
        board.connect()
        board.arm(5.0)
        board.exchange(0.3)
        advance(process, 0.1)
        assert board.exchange(0.3).armed
        assert finish(process, signal.SIGTERM) == 0


@pytest.mark.parametrize("time", ["lockstep", "driven"], ids=["lockstep", "its name in version 0.1"])
def test_events_are_written_to_the_log_file(tmp_path, time):
    log = tmp_path / "events.log"
    with served("--log", str(log), "--time", time) as (process, _):
        process.stdin.close()
        assert process.wait(300) == 0
        assert process.stderr.read() == ""
    assert log.read_text(encoding="utf-8") == "t=0.000 s heater off, end\n"


@pytest.mark.parametrize(
    ("options", "name"),
    [
        (["no-such-sim"], "'no-such-sim'"),
        (["/nowhere/sim.toml"], "/nowhere/sim.toml: "),
        ([SIM, "--profile", "sma-referense"], "'sma-referense'"),
        ([SIM, "--pty", "/nowhere/wire"], "--pty /nowhere/wire: "),
        ([SIM, "--pty", "/dev/null"], "--pty /dev/null: "),
        ([SIM, "--tcp", "0", "--line-speed"], "--line-speed: "),
        ([SIM, "--log", "/nowhere/log"], "--log /nowhere/log: "),
    ],
)
def test_wrong_option_is_rejected_in_one_line(options, name):
    run = programs.run([*COMMAND, *options], capture_output=True, text=True, check=False, stdin=subprocess.DEVNULL)
    assert run.returncode == 2
    assert name in run.stderr
    assert run.stderr.count("\n") == 1


def test_lockstep_time_that_is_no_number_is_rejected():
    run = programs.run(
        [*COMMAND, SIM, "--time", "lockstep"], input="soon\n", capture_output=True, text=True, check=False
    )
    assert run.returncode == 2
    assert "--time lockstep: " in run.stderr
    assert "'soon'" in run.stderr


def test_link_of_a_killed_simulator_is_replaced(tmp_path):
    link = tmp_path / "wire"
    link.symlink_to("/dev/pts/does-not-exist")
    with served("--pty", str(link)) as (process, _):
        assert str(link.readlink()).startswith("/dev/pts/")
        assert link.exists()
        assert finish(process, signal.SIGTERM) == 0
