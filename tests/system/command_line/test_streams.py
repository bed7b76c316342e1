"""Standard output and standard error that cannot be written, or that the reader closes early."""

import json
import os
import subprocess
import sys
from contextlib import closing, contextmanager
from pathlib import Path

import programs
import pytest
from marks import exhaustive

from smadrive.errors import DataError
from smadrive.runs.log.reader import read_log

CONFIGS = Path(__file__).parents[3] / "configs"


def smadrive(*arguments, cwd, is_from_scratch=False, **streams):
    command = [sys.executable, "-m", "smadrive", *map(str, arguments)]
    run = subprocess.run if is_from_scratch else programs.run
    given = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE} | streams
    return run(command, cwd=cwd, text=True, check=False, **given)


@contextmanager
def unread_pipe():
    """Yield the writing end of a pipe that nothing reads."""
    reading, writing = os.pipe()
    os.close(reading)
    with closing(os.fdopen(writing, "w")) as pipe:
        yield pipe


@contextmanager
def full_disk():
    with Path("/dev/full").open("w") as full:
        yield full


@pytest.fixture
def absent_rig(tmp_path):
    """A rig file whose port is missing, so that the heater cannot be confirmed off."""
    text = (CONFIGS / "rigs" / "simulated.toml").read_text()
    rig = tmp_path / "rig.toml"
    rig.write_text(text.replace("/tmp/smadrive-sim", "/dev/ttyNONE"))  # noqa: S108
    return rig


@pytest.mark.parametrize("unbuffered", ["", exhaustive("1")])
@pytest.mark.parametrize("arguments", [("--help",), exhaustive(("--version",)), exhaustive(("probe", "in-process"))])
def test_full_disk_is_an_error_and_a_closed_pipe_is_not(tmp_path, arguments, unbuffered):
    environment = {**os.environ, "PYTHONUNBUFFERED": unbuffered}
    with full_disk() as full:
        done = smadrive(*arguments, cwd=tmp_path, stdout=full, env=environment, is_from_scratch=True)
    assert done.returncode == 2
    assert done.stderr.startswith("smadrive: standard output: cannot be written (No space left on device)")
    assert len(done.stderr.splitlines()) == 1
    with unread_pipe() as pipe:
        unread = smadrive(*arguments, cwd=tmp_path, stdout=pipe, env=environment, is_from_scratch=True)
    assert (unread.returncode, unread.stderr) == (0, "")


def test_closed_pipe_does_not_end_the_work(tmp_path):
    with unread_pipe() as pipe:
        done = smadrive("heat", "in-process", "--current", "0.1", "--for", "1", "-o", "l.h5", cwd=tmp_path, stdout=pipe)
    assert (done.returncode, done.stderr) == (0, "")
    assert read_log(tmp_path / "l.h5").end_time


def test_closed_pipe_ends_watch(tmp_path):
    with unread_pipe() as pipe:
        done = smadrive("watch", "in-process", "--for", "1000", "-o", "l.h5", cwd=tmp_path, stdout=pipe)
    assert (done.returncode, done.stderr) == (0, "")
    assert read_log(tmp_path / "l.h5").column("time_s").size < 100


@pytest.mark.parametrize("opened", [unread_pipe, full_disk])
def test_exit_code_of_off_is_that_of_the_heater(tmp_path, absent_rig, opened):
    with opened() as output:
        done = smadrive("off", "in-process", cwd=tmp_path, stdout=output)
        assert done.returncode == 0
        assert "heater off, confirmed by read-back (board" in done.stderr
        as_json = smadrive("off", "in-process", "--json", cwd=tmp_path, stdout=output)
        assert as_json.returncode == 0
        assert json.loads(as_json.stderr)["safe"]
        assert smadrive("off", absent_rig, cwd=tmp_path, stdout=output).returncode == 3


@pytest.mark.parametrize("opened", [unread_pipe, full_disk])
@pytest.mark.parametrize(("arguments", "code"), [(("prob",), 2), (("off", "rig.toml"), 3), (("list",), 0)])
def test_broken_stderr_changes_no_exit_code(tmp_path, absent_rig, opened, arguments, code):
    with opened() as errors:
        assert smadrive(*arguments, cwd=absent_rig.parent, stderr=errors).returncode == code


@pytest.mark.exhaustive
@pytest.mark.parametrize("command", ["off", "probe"])
def test_command_works_without_a_standard_output(tmp_path, command):
    script = ["sh", "-c", '"$0" -m smadrive $1 in-process --json >&-', sys.executable, command]
    done = subprocess.run(script, cwd=tmp_path, stderr=subprocess.PIPE, text=True, check=False)
    assert done.returncode == 0
    assert json.loads(done.stderr)["safe"] if command == "off" else not done.stderr


OPENED = """
import os, sys
from smadrive.cli.terminal.stdout import open_stdout
open_stdout()
print("closed streams are no error", file=sys.stderr)
nulls = [number for number in range(3) if os.fstat(number).st_rdev == os.stat(os.devnull).st_rdev]
print(*nulls, all(map(os.get_inheritable, range(3))), os.open(os.devnull, os.O_RDONLY) > 2)
"""


@pytest.mark.parametrize(("closed", "nulls"), [("<&-", "0"), ("2>&-", "2"), ("<&- 2>&-", "0 2")])
def test_no_port_gets_the_descriptor_of_a_closed_stream(closed, nulls):
    """The children, such as the guardian, inherit the null device."""
    script = ["sh", "-c", f'"$0" -c "$1" {closed}', sys.executable, OPENED]
    done = subprocess.run(script, stdout=subprocess.PIPE, stdin=subprocess.PIPE, text=True, check=False)
    assert (done.returncode, done.stdout) == (0, f"{nulls} True True\n")


@pytest.mark.exhaustive
def test_calibration_without_a_standard_input_is_not_confirmed(tmp_path):
    (tmp_path / "rig.toml").write_text((CONFIGS / "rigs" / "in-process.toml").read_text())
    script = ["sh", "-c", '"$0" -m smadrive calibrate rig.toml temperature --point 25 <&-', sys.executable]
    done = subprocess.run(script, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == DataError.exit_code
    assert "stdin: the point was not confirmed" in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.exhaustive
@pytest.mark.parametrize("opened", [unread_pipe, full_disk])
def test_simulator_that_cannot_print_its_address_ends_with_one_line(tmp_path, opened):
    command = [sys.executable, "-m", "firmware_sim.cli", "flexinol-lt-0.15mm", "--pty", "port"]
    with opened() as output:
        done = subprocess.run(
            command,
            cwd=tmp_path,
            stdout=output,
            stderr=subprocess.PIPE,
            stdin=subprocess.DEVNULL,
            text=True,
            check=False,
        )
    assert done.returncode == 2
    assert "standard output: cannot be written" in done.stderr
    assert "Traceback" not in done.stderr
    assert "Exception ignored" not in done.stderr
