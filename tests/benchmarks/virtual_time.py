"""The speed of virtual time against real time: taskset -c 0 python tests/benchmarks/virtual_time.py --minutes 10

It runs the shipped in-process rig at 20 Hz in virtual time: plant, sensors, firmware, every register of every exchange
through frames and codec, supervisor, controller, log. The first run is an excitation, the second tracks a sine with the
inverse of the wire identified from it. The benchmark prints the processor time of the best round. All rounds have the
same seed, so their logs must be equal to the last bit. Function calls per tick are counted in a separate run.

Use one core (`taskset`): with more, the threads of scipy's LAPACK wait for each other while the observer's gains are
solved, which adds a tenth of a second of processor time that belongs to no tick.
"""

from __future__ import annotations

import argparse
import cProfile
import hashlib
import os
import pstats
import time
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

from smadrive.control.feedforward.displacement import HysteresisInverse
from smadrive.control.references.shapes import sine
from smadrive.identification.wire import identify_wire
from smadrive.rig.config import load_rig
from smadrive.rig.rig import Rig
from smadrive.runs.log.reader import read_log
from smadrive.runs.run_log import record_excitation, record_tracking
from smadrive.runs.run_metadata import excitation_record, nominal_balance
from smadrive.wire.wire_model import WireModel, travel_mm

RIG = load_rig("in-process")
PERIOD_S = 56.0
ROUNDS = 3


class Run(NamedTuple):
    """Processor time of one run, its simulated time, its ticks, and the digest of its log."""

    took_s: float
    simulated_s: float
    ticks: int
    digest: str


def excite(path):
    with Rig(RIG) as rig:
        excitation = rig.excitation(22.0)
        with record_excitation(path, rig, excitation) as recorder:
            return timed(lambda: rig.excite(excitation, recorder.tick))


def track(path, wire, minutes):
    model, balance = wire.hysteresis.model, wire.thermal.balance
    cold_mm, hot_mm = travel_mm(model)
    low_mm, high_mm = (cold_mm + share * (hot_mm - cold_mm) for share in (0.2, 0.8))
    cycles = 60.0 * minutes / PERIOD_S
    reference = sine(low_mm=low_mm, high_mm=high_mm, period_s=PERIOD_S, cycles=cycles).with_approach(cold_mm, 10.0)
    experiment = reference, WireModel(model, balance), HysteresisInverse(model)
    with Rig(RIG) as rig, record_tracking(path, rig, *experiment) as recorder:
        return timed(lambda: rig.track(*experiment, recorder.tick))


def timed(loop):
    began_s = time.process_time()
    loop()
    return time.process_time() - began_s


def measured(run, folder):
    """Return the fastest of the rounds. AssertionError when two rounds gave different logs."""
    runs = []
    for number in range(ROUNDS):
        path = folder / f"{number}.h5"
        took_s = run(path)
        columns = read_log(path).columns
        path.unlink()
        digest = hashlib.sha256(b"".join(column.tobytes() for column in columns.values())).hexdigest()
        runs.append(Run(took_s, columns["time_s"][-1], len(columns["time_s"]), digest))
    assert len({run.digest for run in runs}) == 1, "the same seed gave different logs"
    return min(runs)


def calls(run, path):
    profile = cProfile.Profile()
    profile.runcall(run, path)
    return pstats.Stats(profile).total_calls


def report(name, run, folder):
    best = measured(run, folder)
    print(
        f"{name}: {best.simulated_s / best.took_s:.0f} x real time ({best.simulated_s:.0f} s, {best.ticks} ticks, "
        f"{1e6 * best.took_s / best.ticks:.0f} us and {calls(run, folder / 'calls.h5') / best.ticks:.0f} calls each); "
        "same seed, same log",
        flush=True,
    )


def main(minutes):
    with TemporaryDirectory() as temporary:
        folder = Path(temporary)
        report("exciting", excite, folder)
        log = read_log(folder / "calls.h5")
        wire = identify_wire(excitation_record(log), nominal_balance(log))
        (folder / "calls.h5").unlink()
        report("tracking", lambda path: track(path, wire, minutes), folder)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=10.0, help="simulated minutes of tracking")
    arguments = parser.parse_args()
    os.nice(10)
    main(arguments.minutes)
