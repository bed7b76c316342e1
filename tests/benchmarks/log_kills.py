"""Logs cut by kill -9: `python tests/benchmarks/log_kills.py [COUNT] [ROWS]` kills COUNT writers at random moments.

Every log is then opened by plain h5py, and must contain every row except those of the last second. ROWS is the number
of rows that the writer expects. With a small number, the writer must enlarge the file again and again.
"""

from __future__ import annotations

import os
import random
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import h5py
import numpy as np

from smadrive.errors import SmadriveError
from smadrive.runs.log.reader import read_log

ROWS_PER_S = 20
WRITER = """
import os, sys
from pathlib import Path
from smadrive.runs.log.recorder import Recorder

columns = ["time_s", *(f"value{n}_c" for n in range(15))]
with Recorder(Path(sys.argv[1]), columns, {"rig": "bench"}, rows=int(sys.argv[2])) as recorder:
    n = 0
    while True:
        recorder.row((0.05 * n,) * len(columns))
        n += 1
        os.write(1, n.to_bytes(8, "little"))
"""


def killed_log(path: Path, rows: int, after_s: float) -> int:
    """Start a writer and kill it `after_s` after its first row. Return the number of rows that it had written."""
    with subprocess.Popen([sys.executable, "-c", WRITER, path, str(rows)], stdout=subprocess.PIPE) as writer:
        pipe = writer.stdout.fileno()
        last = os.read(pipe, 8)
        end_s = time.monotonic() + after_s
        while time.monotonic() < end_s:
            last = os.read(pipe, 1 << 16)[-8:]
        writer.kill()
        while rest := os.read(pipe, 1 << 16):
            last = rest[-8:]
    return int.from_bytes(last, "little")


def check(path: Path, handed_over: int) -> None:
    """Assert that h5py opens the log, and that it lacks at most the rows of the last second."""
    with h5py.File(path) as file:
        assert file["time_s"].shape == file["value14_c"].shape
    log = read_log(path)
    time_s = log.column("time_s")
    assert handed_over - ROWS_PER_S <= time_s.size <= handed_over + 1, f"{time_s.size} of {handed_over} rows"
    for values in log.columns.values():
        np.testing.assert_array_equal(values, 0.05 * np.arange(time_s.size))
    assert log.end_time == ""


def main() -> None:
    """Kill writers, check their logs, print the number of good ones."""
    count, rows = (int(text) for text in (*sys.argv[1:], "100", "200000")[:2])
    failed = 0
    with tempfile.TemporaryDirectory() as folder:
        for n in range(count):
            path = Path(folder) / f"{n}.h5"
            handed_over = killed_log(path, rows, random.uniform(0.0, 0.5))
            try:
                check(path, handed_over)
            except (AssertionError, OSError, SmadriveError) as error:
                failed += 1
                print(f"{n}: {type(error).__name__} {error}")
    print(f"{count - failed} of {count} logs open and lack less than a second")


if __name__ == "__main__":
    main()
