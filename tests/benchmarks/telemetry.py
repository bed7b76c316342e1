"""Telemetry and the loop, in real time: python tests/benchmarks/telemetry.py [--minutes 10] [--outage-s 60]

A simulated board is served on a pseudo-terminal, and mosquitto runs on loopback. The rig runs at 20 Hz under a loop
that holds a small current. Each row is one run:

    without        nothing is published
    published      the broker is up for `--minutes`: a subscriber counts every sample
    stopped        the broker is ended, and started again after `--outage-s`
    hung           the broker gets SIGSTOP, and SIGCONT after `--outage-s`
    restarted      the broker is restarted ten times

The figures: percentiles of the lateness of the ticks, their ratio to the run without a broker, samples that were
published, received, lost (never received) and repeated, the counts of the publisher, and the largest memory of the
publisher process. The runs of an outage last three times `--outage-s`.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from peers.mosquitto import MosquittoBroker, Subscriber, wait_for
from served import PATIENT, served, with_limits

from smadrive.files.shipped import configs_dir
from smadrive.rig.config import load_rig
from smadrive.runs.log.reader import read_log

CURRENT_A = 0.1
CASES = ("stopped", "hung", "restarted", "published")
SLOW_S = 8.0
"""Time that the board and the supervisor wait on a busy machine: a trip would end a measurement."""


@dataclass
class Result:
    """The figures of one run."""

    p50_ms: float
    p99_ms: float
    max_ms: float
    ticks: int
    published: dict[str, int]
    received: int
    lost: int
    repeated: int
    memory_mb: float
    tripped: str | None


def rig_file(folder: Path, url: str) -> Path:
    """Write the rig file of the served board."""
    text = (configs_dir() / "rigs" / "simulated.toml").read_text(encoding="utf-8")
    text = with_limits(text, SLOW_S, SLOW_S)
    (folder / "rig.toml").write_text(text.replace(load_rig("simulated").devices[0].url, url + PATIENT))
    return folder / "rig.toml"


def memory_of_children_mb(pid: int) -> float:
    """Return the resident memory of the publisher process among the children of a process, in MB."""
    found = 0.0
    for child in Path(f"/proc/{pid}/task/{pid}/children").read_text().split():
        if "smadrive.telemetry.process" in Path(f"/proc/{child}/cmdline").read_text():
            pages = int(Path(f"/proc/{child}/statm").read_text().split()[1])
            found = max(found, pages * os.sysconf("SC_PAGESIZE") / 1e6)
    return found


def measured(
    folder: Path, duration_s: float, broker: MosquittoBroker | None, disturb: Callable[[MosquittoBroker], None]
) -> Result:
    """Run `heat` for `duration_s`, with `disturb` in a thread, and return the figures."""
    log_file, memory_mb = folder / f"{time.monotonic_ns()}.h5", 0.0
    with served("--pty", str(folder / f"port{time.monotonic_ns()}")) as (_, url):
        command = [sys.executable, "-m", "smadrive", "heat", str(rig_file(folder, url))]
        command += ["--current", str(CURRENT_A), "--for", str(duration_s), "-o", str(log_file), "--json"]
        command += [] if broker is None else ["--publish", broker.url]
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as driver:
            if broker is not None:
                threading.Thread(target=disturb, args=(broker,), daemon=True).start()
            while driver.poll() is None:
                time.sleep(0.5)
                memory_mb = max(memory_mb, memory_of_children_mb(driver.pid) if driver.poll() is None else 0.0)
            result = json.loads(driver.communicate()[0])
    late_ms = 1e3 * read_log(log_file).column("late_s")
    p50, p99 = np.percentile(late_ms, (50, 99))
    return Result(
        p50, p99, late_ms.max(), len(late_ms), result.get("published", {}), 0, 0, 0, memory_mb, result["tripped"]
    )


def with_subscriber(
    folder: Path, duration_s: float, disturb: Callable[[MosquittoBroker], None] = lambda _: None
) -> Result:
    """Run with a broker and a subscriber, and count what the subscriber gets.

    The broker keeps the subscriber's session. Otherwise the samples that it confirms between a restart and the return
    of the subscriber would count as lost.
    """
    with MosquittoBroker(folder, remembers=True) as broker, Subscriber(broker, "recorder") as subscriber:
        result = measured(folder, duration_s, broker, disturb)
        wait_for(lambda: subscriber.texts("driver")[-1:] == ["ended"])
        numbers = [json.loads(text)["number"] for text in subscriber.texts("sample")]
    result.received, result.repeated = len(set(numbers)), len(numbers) - len(set(numbers))
    result.lost = result.ticks - result.received
    return result


def stop(outage_s: float) -> Callable[[MosquittoBroker], None]:
    """Return the outage of a broker that is ended and started again."""

    def disturb(broker: MosquittoBroker) -> None:
        time.sleep(outage_s)
        broker.stop()
        time.sleep(outage_s)
        broker.start()

    return disturb


def hang(outage_s: float) -> Callable[[MosquittoBroker], None]:
    """Return the outage of a broker that hangs."""

    def disturb(broker: MosquittoBroker) -> None:
        time.sleep(outage_s)
        broker.hang()
        time.sleep(outage_s)
        broker.resume()

    return disturb


def restart(outage_s: float) -> Callable[[MosquittoBroker], None]:
    """Return the outages of a broker that is restarted ten times."""

    def disturb(broker: MosquittoBroker) -> None:
        for _ in range(10):
            time.sleep(outage_s / 5)
            broker.stop()
            broker.start()

    return disturb


def line(name: str, result: Result, without: Result) -> str:
    """Return the row of a run."""
    counts = result.published
    shown = [counts.get(key, 0) for key in ("samples", "dropped", "waiting", "connections")]
    return (
        f"{name:<11}{result.ticks:>7}{result.p50_ms:>9.3f}{result.p99_ms:>9.3f}{result.max_ms:>9.2f}"
        f"{result.p99_ms / without.p99_ms:>8.2f}{result.received:>10}{result.lost:>6}{result.repeated:>10}"
        f"{'':>3}{' / '.join(map(str, shown)):<26}{result.memory_mb:>7.1f}"
        f"{'' if result.tripped is None else f'  TRIPPED: {result.tripped}'}"
    )


def main() -> None:
    """Run every case, and print a row for each."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--outage-s", type=float, default=60.0)
    parser.add_argument("--cases", nargs="+", default=list(CASES), choices=CASES, help="cases to run, in this order")
    arguments = parser.parse_args()
    print(
        f"{'run':<11}{'ticks':>7}{'p50 ms':>9}{'p99 ms':>9}{'max ms':>9}{'ratio':>8}{'received':>10}{'lost':>6}"
        f"{'repeated':>10}   {'sent/dropped/waiting/conn':<26}{'MB':>7}"
    )
    outage_s = arguments.outage_s
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        without = measured(folder, 3.0 * outage_s, None, lambda _: None)
        print(line("without", without, without), flush=True)
        cases = {
            "stopped": (3.0 * outage_s, stop(outage_s)),
            "hung": (3.0 * outage_s, hang(outage_s)),
            "restarted": (3.0 * outage_s, restart(outage_s)),
            "published": (60.0 * arguments.minutes, lambda _: None),
        }
        for case in arguments.cases:
            duration_s, disturb = cases[case]
            print(line(case, with_subscriber(folder, duration_s, disturb), without), flush=True)
        again = measured(folder, 3.0 * outage_s, None, lambda _: None)
        print(line("without", again, without), flush=True)


if __name__ == "__main__":
    main()
