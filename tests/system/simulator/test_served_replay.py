"""Record the bus of a served simulator, then serve the recording."""

import json
import sys

import programs
import pytest
from marks import exhaustive
from served import COMMAND, PATIENT, SIM, served

from smadrive.devices.device import Device
from smadrive.devices.profile.profile import load_profile
from smadrive.errors import DeadlineError
from smadrive.files.kinds import RIG
from smadrive.files.shipped import config_file
from smadrive.modbus import requests
from smadrive.modbus.bus import BusTiming
from smadrive.modbus.client import ModbusClient
from smadrive.modbus.trace import TraceFile
from smadrive.modbus.transports.connect import open_transport

PROFILE = load_profile("sma-reference")
NAMES = ("serial_number", "temperature", "sample_counter", "watchdog_s", "uptime")


def read(url, trace_path=None):
    with open_transport(url + PATIENT, PROFILE.serial_settings()) as transport:
        if trace_path is None:
            return readings(ModbusClient(transport))
        with TraceFile(trace_path, transport) as trace:
            return readings(ModbusClient(transport, trace))


def readings(client):
    device = Device(PROFILE, client)
    device.check_identity()
    return [device.read(NAMES) for _ in range(3)]


@pytest.mark.parametrize("option", [exhaustive("--pty"), "--tcp"])
def test_recording_is_served_as_the_recorded_device(option, tmp_path):
    path = tmp_path / "bus.trace"
    with served() as (_, url):
        recorded = read(url, path)
    address = str(tmp_path / "port") if option == "--pty" else "0"
    with served("--replay", str(path), option, address, sim=None) as (process, url):
        assert read(url) == recorded
        with open_transport(url, PROFILE.serial_settings()) as transport, pytest.raises(DeadlineError):
            ModbusClient(transport).execute(1, requests.read_holding(32, 1), BusTiming(0.1, read_retries=0))
        assert "not in the recording: unit 1, read 1 holding registers from 32" in process.stderr.readline()


@pytest.mark.parametrize(
    ("options", "name"),
    [
        (["--replay", "/nowhere/bus.trace"], "/nowhere/bus.trace: "),
        ([SIM, "--replay", "/nowhere/bus.trace"], "--replay: "),
        (["--replay", "/nowhere/bus.trace", "--seed", "3"], "--replay: "),
        ([], "no SIM.toml"),
    ],
)
def test_wrong_option_is_rejected_in_one_line(options, name):
    run = programs.run([*COMMAND, *options], capture_output=True, text=True, check=False)
    assert run.returncode == 2
    assert name in run.stderr
    assert run.stderr.count("\n") == 1


def probe(port, *options, cwd):
    """`smadrive probe` on the shipped rig with its board at this port."""
    rig = config_file("simulated", RIG).read_text(encoding="utf-8")
    rig = rig.replace("/tmp/smadrive-sim?", f"{port}?latency_ms=2000&")  # noqa: S108  (enough on a busy machine)
    (cwd / "rig.toml").write_text(rig, encoding="utf-8")
    command = [sys.executable, "-m", "smadrive", "probe", "rig.toml", *options, "--json"]
    return programs.run(command, cwd=cwd, capture_output=True, text=True, check=False)


@pytest.mark.exhaustive
def test_trace_of_a_command_answers_the_same_command(tmp_path):
    there, again = tmp_path / "there", tmp_path / "again"
    with served("--pty", str(there)):
        first = probe(there, "--trace", "traces", cwd=tmp_path)
        second_trace = probe(there, "--trace", "traces", cwd=tmp_path)
    assert first.returncode == 0, first.stderr
    assert second_trace.returncode == 2
    assert "traces/board.trace" in second_trace.stderr
    trace = (tmp_path / "traces" / "board.trace").read_text()
    assert "| unit 1: read 5 holding registers from 0" in trace
    assert "| unit 1: write register" in trace
    with served("--replay", "traces/board.trace", "--pty", str(again), sim=None, cwd=tmp_path):
        second = probe(again, cwd=tmp_path)
    assert second.returncode == 0, second.stderr
    recorded, replayed = json.loads(first.stdout), json.loads(second.stdout)
    for name in ("devices", "temperature_c", "displacement_mm", "current_a", "voltage_v", "device_faults"):
        assert replayed[name] == recorded[name]
