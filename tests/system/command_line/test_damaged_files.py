"""A command with a damaged file gives a result or a typed error. tests/benchmarks/fuzz_files.py tries more files."""

import subprocess
import sys
from pathlib import Path

import pytest


@pytest.mark.exhaustive
@pytest.mark.timeout(2400)  # two minutes of processor time, of which a busy machine gives a part
def test_damaged_files_end_in_a_result_or_a_typed_error():
    """The fuzzer runs in a separate process, because forking a process of the tests is not safe."""
    command = [sys.executable, str(Path(__file__).parents[2] / "benchmarks" / "fuzz_files.py"), "2", "7"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
