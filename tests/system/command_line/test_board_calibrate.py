"""`smadrive board calibrate` rejects what it cannot use, before it opens a port."""

import sys

import programs
import pytest


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
