"""Damaged files of every kind end in a result or in a typed error; full size: tests/benchmarks/fuzz_files.py."""

import subprocess
import sys
from pathlib import Path

import pytest


@pytest.mark.exhaustive
def test_damaged_files_end_in_a_result_or_a_typed_error():
    """The fuzzer runs in a process of its own, which can be forked safely."""
    command = [sys.executable, str(Path(__file__).parents[2] / "benchmarks" / "fuzz_files.py"), "2", "7"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
