"""`smadrive board check` on a served board."""

import json
import subprocess
import sys

import programs
import pytest
from marks import exhaustive

FAULTS = '[[faults]]\nat_s = 0.0\nname = "break_wire"\n'


def check(*arguments):
    command = [sys.executable, "-m", "smadrive", "board", "check", *arguments]
    return programs.run(command, check=False, capture_output=True, text=True)


def checked(tmp_path, *options):
    """The outcome of the check of a simulated board without a wire."""
    (tmp_path / "faults.toml").write_text(FAULTS)
    command = [sys.executable, "-m", "firmware_sim.cli", "flexinol-lt-0.15mm", "--faults", tmp_path / "faults.toml"]
    with programs.Program([*command, *options], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        try:
            return check(process.stdout.readline().strip(), "--json")
        finally:
            process.kill()


@pytest.mark.exhaustive
def test_served_board_passes(tmp_path):
    done = checked(tmp_path)
    assert done.returncode == 0, done.stderr
    verdicts = {one["name"]: one["verdict"] for one in json.loads(done.stdout)["checks"]}
    assert "failed" not in verdicts.values()
    assert verdicts["identity"] == "passed"


@pytest.mark.exhaustive
def test_board_of_version_1_is_a_device_error(tmp_path):
    done = checked(tmp_path, "--profile", "sma-reference:map_version=1")
    assert done.returncode == 3
    assert "map_version = 1" in done.stderr


@pytest.mark.parametrize(("port", "code"), [("/dev/no-such-port", 3), exhaustive("tcp://127.0.0.1:502", 2)])
def test_port_that_cannot_be_used_is_an_error(port, code):
    assert check(port).returncode == code
