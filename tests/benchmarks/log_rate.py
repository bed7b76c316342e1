"""Rows per second of a log, against peers measured in the same run: python tests/benchmarks/log_rate.py

Like the log, the peers leave at most one second of 20 rows unwritten: a CSV file, and HDF5's single-writer mode.
"""

from __future__ import annotations

import csv
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np

from smadrive.runs.log.recorder import Recorder

COLUMNS = ("time_s", *(f"value{n}_c" for n in range(15)))
ROWS_PER_S = 20


def rows(count):
    """Return the rows of a loop at 20 Hz."""
    for n in range(count):
        yield (0.05 * n,) * len(COLUMNS)


def log(path, count):
    with Recorder(path, COLUMNS) as recorder:
        for row in rows(count):
            recorder.row(row)


def csv_file(path, count):
    with path.open("w") as file:
        writer = csv.writer(file)
        for n, row in enumerate(rows(count)):
            writer.writerow(row)
            if n % ROWS_PER_S == 0:
                file.flush()


def single_writer(path, count):
    with h5py.File(path, "w", libver="latest") as file:
        for name in COLUMNS:
            file.create_dataset(name, (0,), "f8", chunks=(1024,), maxshape=(None,))
        file.swmr_mode = True
        block = []
        for row in rows(count):
            block.append(row)
            if len(block) == ROWS_PER_S:
                values = np.array(block)
                block.clear()
                for n, name in enumerate(COLUMNS):
                    dataset = file[name]
                    dataset.resize(dataset.shape[0] + ROWS_PER_S, axis=0)
                    dataset[-ROWS_PER_S:] = values[:, n]
                file.flush()


def rate(write: Callable[[Path, int], None], count: int) -> float:
    """Return the rows per second, the best of three runs."""
    best_s = np.inf
    with tempfile.TemporaryDirectory() as folder:
        for n in range(3):
            begun_s = time.perf_counter()
            write(Path(folder) / f"{n}", count)
            best_s = min(best_s, time.perf_counter() - begun_s)
    return count / best_s


def slowest_row_ms(count: int) -> float:
    """Return the longest time that one row took, in a log of known length."""
    worst_s = 0.0
    with tempfile.TemporaryDirectory() as folder, Recorder(Path(folder) / "l.h5", COLUMNS, rows=count) as recorder:
        for row in rows(count):
            begun_s = time.perf_counter()
            recorder.row(row)
            worst_s = max(worst_s, time.perf_counter() - begun_s)
    return 1e3 * worst_s


def main() -> None:
    """Print rates and ratios."""
    ours, text, swmr = rate(log, 50_000), rate(csv_file, 50_000), rate(single_writer, 5_000)
    print(f"log                  {ours:10.0f} rows/s, slowest row {slowest_row_ms(20_000):.2f} ms")
    print(f"CSV                  {text:10.0f} rows/s, log {ours / text:.1f} x")
    print(f"HDF5 single-writer   {swmr:10.0f} rows/s, log {ours / swmr:.1f} x")


if __name__ == "__main__":
    main()
