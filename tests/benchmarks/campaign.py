"""The figures of a campaign: PYTHONPATH=. python tests/benchmarks/campaign.py speed|same|kills|resume [--runs N]

speed    runs that excite, identify and track (six minutes of wire time each), on one worker and on all cores: the ratio
         of the times, the processor time besides the runs, and the memory of the workers; beside it the ratio of plain
         processes without Dask, because the cores of a machine may share their units
same     short runs of a known wire on 8 workers and on 1 worker, both at once: the tables must be equal to the last bit
kills    short runs while a worker is killed (kill -9) every few seconds: the same table as without
resume   the command is killed (kill -9) several times and goes on with --resume: the same table as without

Ratios need a quiet machine; the load is printed. Every campaign is a process of its own, as a user starts it.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path
from tempfile import TemporaryDirectory

import pandas as pd
import psutil

from smadrive.campaigns.execution.cluster import usable_cores

LONG = """
title = "excite, identify, track"
seed = 1
[run]
reference = "sine"
[run.wire]
kind = "duhem"
[[vary]]
random_wires = {runs}
[references.sine]
shape = "sine:period_s=56,cycles=2"
[report]
worst_logs = 0
"""
SHORT = """
title = "half a minute on a known wire"
seed = 1
[run]
model = "{model}"
reference = "sine"
[[vary]]
repeats = {runs}
[references.sine]
shape = "sine:period_s=20,cycles=1"
smooth = false
[report]
worst_logs = 0
"""
PYTHON = (sys.executable, "-m", "smadrive")
PLAIN = """
import sys
from smadrive.campaigns.experiments.run import execute
from smadrive.campaigns.plan.plan import load_plan
plan = load_plan(sys.argv[1])
for number in range(int(sys.argv[2])):
    execute(plan.run(number))
"""
PLAIN_RUNS = 8


class Observer:
    """Watches the processes of a campaign: their processor time, and the largest memory of a worker."""

    def __init__(self, process: subprocess.Popen) -> None:
        self.process = psutil.Process(process.pid)
        self.rss_mb: dict[int, list[float]] = {}
        self.cpu_s: dict[int, float] = {}
        threading.Thread(target=self._watch, daemon=True).start()

    def workers(self) -> list[psutil.Process]:
        return [child for child in self.process.children(recursive=True) if is_worker(child)]

    def _watch(self) -> None:
        while True:
            try:
                for one in (self.process, *self.process.children(recursive=True)):
                    times = one.cpu_times()
                    self.cpu_s[one.pid] = times.user + times.system
                    if one.pid != self.process.pid and is_worker(one):
                        self.rss_mb.setdefault(one.pid, []).append(one.memory_info().rss / 1e6)
            except psutil.Error:
                if not self.process.is_running():
                    return
            time.sleep(1.0)


def is_worker(process: psutil.Process) -> bool:
    try:
        return "multiprocessing.spawn" in " ".join(process.cmdline())
    except psutil.Error:
        return False


def start(campaign: Path, folder: Path, *options: str) -> subprocess.Popen:
    command = (*PYTHON, "campaign", str(campaign), "-o", str(folder), "--json", *options)
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def finished(process: subprocess.Popen) -> dict:
    out, err = process.communicate()
    if process.returncode:
        raise SystemExit(err)
    return json.loads(out)


def took_s(folder: Path) -> float:
    """The time from the beginning of the first run to the end of the last one."""
    effort = pd.read_parquet(folder / "effort.parquet")
    began = pd.to_datetime(effort["began"])
    identification_s = effort["identification_cpu_s"].iloc[began.argmin()]
    ends = began + pd.to_timedelta(effort["duration_s"], unit="s")
    return (ends.max() - began.min()).total_seconds() + identification_s


def speed(here: Path, runs: int) -> None:
    campaign = here / "long.toml"
    campaign.write_text(LONG.format(runs=runs))
    times = {}
    for workers in (1, usable_cores()):
        folder = here / f"speed-{workers}"
        process = start(campaign, folder, "--workers", str(workers))
        observer = Observer(process)
        result = finished(process)
        effort = pd.read_parquet(folder / "effort.parquet")
        cpu_s = float(effort["cpu_s"].sum() + effort["identification_cpu_s"].sum())
        times[workers] = took_s(folder)
        main_s = observer.cpu_s.pop(process.pid)
        spent_s = sum(observer.cpu_s.values())
        peaks = ", ".join(
            f"{first_half(one):.0f} -> {max(one):.0f} MB" for one in observer.rss_mb.values() if len(one) > 4
        )
        print(
            f"{runs} runs on {workers} worker(s): {times[workers]:.0f} s; processor time of the runs {cpu_s:.0f} s, "
            f"of all workers {spent_s:.0f} s, of command and scheduler with start and report {main_s:.0f} s; memory "
            f"per worker (first half -> largest): {peaks}; load {os.getloadavg()[0]:.1f}; {result['sha256'][:16]}",
            flush=True,
        )
    reached, possible = times[1] / times[usable_cores()], plain_ratio(campaign)
    print(f"{reached:.2f} x with {usable_cores()} workers; plain processes: {possible:.2f} x")


def plain_ratio(campaign: Path) -> float:
    """Return the rate of runs of one plain process per core, divided by the rate of one process alone."""
    command = (sys.executable, "-c", PLAIN, str(campaign), str(PLAIN_RUNS))
    environment = os.environ | {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}  # as in a worker of Dask
    times = []
    for count in (1, usable_cores()):
        began = time.perf_counter()
        for process in [subprocess.Popen(command, env=environment) for _ in range(count)]:
            process.wait()
        times.append(time.perf_counter() - began)
    return usable_cores() * times[0] / times[1]


def first_half(values: list[float]) -> float:
    return max(values[: max(len(values) // 2, 1)])


def same(here: Path, runs: int) -> None:
    campaign = short(here, runs)
    processes = {workers: start(campaign, here / f"same-{workers}", "--workers", str(workers)) for workers in (8, 1)}
    digests = set()
    for workers, process in processes.items():
        result = finished(process)
        digests.add(result["sha256"])
        print(f"{runs} short runs on {workers} worker(s): {result['failed']} failed; {result['sha256']}", flush=True)
    print("the tables are", "equal" if len(digests) == 1 else "DIFFERENT")


def kills(here: Path, runs: int, every_s: float) -> None:
    undisturbed = finished(start(short(here, runs), here / "undisturbed"))["sha256"]
    process = start(short(here, runs), here / "killed")
    observer, killed = Observer(process), 0
    while process.poll() is None:
        try:
            process.wait(every_s)
        except subprocess.TimeoutExpired:
            if workers := observer.workers():
                random.choice(workers).kill()
                killed += 1
    disturbed = finished(process)
    print(f"{runs} short runs, {killed} workers killed: {disturbed['failed']} failed runs; the tables are", end=" ")
    print("equal" if undisturbed == disturbed["sha256"] else "DIFFERENT")


def resume(here: Path, runs: int) -> None:
    undisturbed = finished(start(short(here, runs), here / "whole"))["sha256"]
    folder, killed = here / "pieces", 0
    while True:
        options = ("--resume",) if killed else ()
        process = start(short(here, runs), folder, *options)
        wait_for_lines(folder / "journal.jsonl", runs * (killed + 1) // 4)
        if killed == 3:
            break
        process.send_signal(signal.SIGKILL)
        process.communicate()
        killed += 1
    again = finished(process)["sha256"]
    print(f"{runs} short runs, the command killed {killed} times: the tables are", end=" ")
    print("equal" if undisturbed == again else "DIFFERENT")


def wait_for_lines(journal: Path, count: int) -> None:
    while not journal.exists() or journal.read_bytes().count(b"\n") < count:
        time.sleep(0.1)


def short(here: Path, runs: int) -> Path:
    """The campaign file of short runs, and the model of its wire."""
    model, campaign = here / "wire.json", here / "short.toml"
    if not model.exists():
        for command in (("excite", "in-process", "-o", here / "e.h5"), ("identify", here / "e.h5", "-o", model)):
            subprocess.run([*PYTHON, *map(str, command)], check=True, stdout=subprocess.DEVNULL)
    campaign.write_text(SHORT.format(model=model, runs=runs))
    return campaign


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("figure", choices=("speed", "same", "kills", "resume"))
    parser.add_argument(
        "--runs", type=int, help="number of runs; by default 300 for speed, 10000 for same, 300 otherwise"
    )
    parser.add_argument("--every", type=float, default=20.0, help="time between two kills in s")
    arguments = parser.parse_args()
    with TemporaryDirectory() as temporary:
        place = Path(temporary)
        match arguments.figure:
            case "speed":
                speed(place, arguments.runs or 300)
            case "same":
                same(place, arguments.runs or 10_000)
            case "kills":
                kills(place, arguments.runs or 300, arguments.every)
            case "resume":
                resume(place, arguments.runs or 300)
