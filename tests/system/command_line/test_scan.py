"""`smadrive scan` on a served device: proved profiles, possible profiles, no device."""

import contextlib
import json
import os
import subprocess
import sys

import programs
import pytest

from smadrive.devices.state.lock import Role, lock_line
from smadrive.modbus.transports.connect import port_of
from smadrive.rig.ports.discovery import port_url


@contextlib.contextmanager
def served(profile):
    command = [sys.executable, "-m", "firmware_sim.cli", "flexinol-lt-0.15mm", "--profile", profile]
    with programs.Program(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        try:
            yield process.stdout.readline().strip()
        finally:
            process.kill()


def scan(*arguments):
    command = [sys.executable, "-m", "smadrive", "scan", *arguments]
    return programs.run(command, check=False, capture_output=True, text=True)


@pytest.mark.exhaustive
@pytest.mark.parametrize(
    ("profile", "proved", "possible"),
    [("riden-rd60xx", ["riden-rd60xx"], []), ("baumer-om20", [], ["baumer-om20"])],
)
def test_device_is_found_with_the_profiles_that_match(profile, proved, possible):
    with served(profile) as url:
        done = scan(f"{url}?baudrate=9600", "--units", "1", "--json")
    assert done.returncode == 0, done.stderr
    (found,) = json.loads(done.stdout)["devices"]
    assert found["unit_id"] == 1
    assert found["profiles"] == proved
    assert found["possible"] == possible


def test_line_in_use_is_not_scanned():
    with served("riden-rd60xx") as url, lock_line(port_of(url), Role.DRIVER):
        done = scan(url, "--units", "1")
    assert done.returncode == 3
    assert f"process {os.getpid()}" in done.stderr


@pytest.mark.exhaustive
def test_scan_prints_the_entry_of_a_rig_file():
    with served("sma-reference") as url:
        printed = scan(url, "--units", "1").stdout
    assert 'profile = "sma-reference"' in printed
    assert f'url = "{url}?baudrate=115200&parity=N&stopbits=1"' in printed


@pytest.mark.exhaustive
def test_scan_prints_the_settings_with_which_the_device_answered():
    with served("sma-reference") as url:
        printed = scan(f"{url}?parity=E&latency_ms=100", "--units", "1").stdout
    assert "115200 8E1" in printed
    assert f'url = "{url}?parity=E&latency_ms=100&baudrate=115200&stopbits=1"' in printed


def test_no_device_and_invalid_unit_ids_are_errors():
    with served("sma-reference") as url:
        nobody = scan(f"{url}?baudrate=9600", "--units", "7-8")
    assert nobody.returncode == 3
    assert "none of the units 7-8 answers" in nobody.stderr
    for units in ("x", "5-1", "300", ""):
        assert scan("serial:///dev/ttyNONE", "--units", units).returncode == 2


@pytest.mark.exhaustive
def test_port_may_be_a_path():
    with served("sma-reference") as url:
        path = url.removeprefix("serial://").partition("?")[0]
        done = scan(f"{path}?baudrate=115200", "--units", "1", "--json")
        printed = scan(path, "--units", "1").stdout
    (found,) = json.loads(done.stdout)["devices"]
    assert found["profiles"] == ["sma-reference"]
    assert f'url = "serial://{path}?baudrate=115200&parity=N&stopbits=1"' in printed


def test_device_among_empty_units_is_found():
    with served("sma-reference") as url:
        done = scan(f"{url}?baudrate=115200", "--units", "1-4", "--json")
    assert [found["unit_id"] for found in json.loads(done.stdout)["devices"]] == [1]


@pytest.mark.parametrize(
    ("port", "url"),
    [
        ("/dev/ttyUSB0", "serial:///dev/ttyUSB0"),
        ("/dev/serial/by-id/x?baudrate=9600", "serial:///dev/serial/by-id/x?baudrate=9600"),
        ("null", "serial:///dev/null"),
        ("tcp://host:502", "tcp://host:502"),
        ("192.168.1.10", "192.168.1.10"),
    ],
)
def test_url_of_a_port(port, url):
    assert port_url(port) == url
