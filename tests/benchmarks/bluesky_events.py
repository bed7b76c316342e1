"""Events per second, and the end of the current after an abort: python tests/benchmarks/bluesky_events.py

A run engine without other subscribers than a counter reads the wire of the shipped rig. Virtual time is that of
`sim://`, real time that of a simulated board on a pseudo-terminal, at 20 Hz.

    count           heater off: each event is a measurement at zero current
    hold            heater on: each event is a fresh tick of the loop
    read            heater on: each event is the latest tick, without a trigger
    flight          the events of a flight for each second of the flight, approach included; in real time at most 20
    ophyd.sim       the same plan with the simulated detector that bluesky brings along, if ophyd is installed
    abort           real time: from `RE.abort()` of a plan that runs and heats until the board disarms, at zero current;
                    and until the engine returns: it waits for the read-back and for the health record of the wire
"""

from __future__ import annotations

import logging
import os
import sys
import tempfile
import threading
import time
from collections.abc import Iterable, Iterator
from contextlib import suppress
from pathlib import Path
from queue import SimpleQueue
from statistics import median
from typing import Any

import bluesky.plan_stubs as bps
import bluesky.plans as bp
import bluesky.preprocessors as bpp
from bluesky.run_engine import RunEngine
from bluesky.utils import RunEngineInterrupted

sys.path.insert(0, str(Path(__file__).parents[1]))

from served import PATIENT, served

import smadrive
from smadrive.bluesky import SmaWire
from smadrive.rig.config import load_rig

EVENTS = 500
ABORTS = 10
LIMIT_S = 0.5
"""Longest permitted time from an abort to zero current, s."""


class Counter:
    """Notes when the events of a run engine arrive."""

    def __init__(self) -> None:
        self.times_s: list[float] = []

    def __call__(self, name: str, document: dict[str, Any]) -> None:
        """Note a document."""
        events = (name == "event") + (len(document["seq_num"]) if name == "event_page" else 0)
        self.times_s += [time.perf_counter()] * events


def held(wire: SmaWire, events: int, *, is_triggered: bool) -> Iterator[Any]:
    """Return the plan that holds the wire at a displacement and reads it."""

    @bpp.stage_decorator([wire])
    @bpp.run_decorator()
    def plan() -> Iterator[Any]:
        yield from bps.mv(wire, 5.0)
        for _ in range(events):
            if is_triggered:
                yield from bps.trigger_and_read([wire])
            else:
                yield from bps.create()
                yield from bps.read(wire)
                yield from bps.save()

    return plan()


def rate(engine: RunEngine, counter: Counter, plan: Iterator[Any]) -> float:
    """Run a plan, and return its events per second from the first to the last event."""
    counter.times_s.clear()
    engine(plan)
    return (len(counter.times_s) - 1) / (counter.times_s[-1] - counter.times_s[0])


def flight_rate(engine: RunEngine, counter: Counter, wire: SmaWire) -> float:
    """Return the events of a flight per second of the flight, its approach included."""
    counter.times_s.clear()
    began_s = time.perf_counter()
    engine(bpp.stage_wrapper(bp.fly([wire]), [wire]))
    return len(counter.times_s) / (time.perf_counter() - began_s)


def rates(engine: RunEngine, counter: Counter, rig: smadrive.OpenRig, wire_file: Path, events: int) -> dict[str, float]:
    """Return the rate of each plan."""
    wire = SmaWire(rig, wire_file, tolerance_mm=0.3)
    wire.prepare(smadrive.sine(low_mm=3, high_mm=7, period_s=20, cycles=1))
    return {
        "count": rate(engine, counter, bp.count([wire], events)),
        "hold": rate(engine, counter, held(wire, events, is_triggered=True)),
        "read": rate(engine, counter, held(wire, events, is_triggered=False)),
        "flight": flight_rate(engine, counter, wire),
    }


class Disarmed:
    """Notes when a simulated board disarms: it writes a line then, and has no current from that moment."""

    def __init__(self, lines: Iterable[str]) -> None:
        self.times_s: SimpleQueue[float] = SimpleQueue()
        threading.Thread(target=self._note, args=(lines,), daemon=True).start()

    def _note(self, lines: Iterable[str]) -> None:
        for line in lines:
            if line.endswith("disarmed\n"):
                self.times_s.put(time.perf_counter())


def abort_s(engine: RunEngine, wire: SmaWire, disarmed: Disarmed) -> tuple[float, float]:
    """Abort a move that never settles. Return the times until the board disarms and until the engine returns."""
    wire.configure(tolerance_mm=1e-6, timeout_s=1e3)
    aborted_s: list[float] = []

    def abort() -> None:
        aborted_s.append(time.perf_counter())
        engine.abort()

    threading.Timer(3.0, abort).start()
    with suppress(RunEngineInterrupted):
        engine(bp.scan([], wire, 6.0, 8.0, 2))
    returned_s = time.perf_counter()
    while (disarmed_s := disarmed.times_s.get(timeout=60.0)) < aborted_s[0]:
        pass  # of an earlier run
    return disarmed_s - aborted_s[0], returned_s - aborted_s[0]


def main() -> None:
    """Print a table of rates, and the times of the aborts."""
    logging.getLogger("bluesky").setLevel(logging.CRITICAL)
    engine, counter = RunEngine({}), Counter()
    engine.subscribe(counter)
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        with smadrive.open_rig("in-process") as rig:
            smadrive.identify(rig.excite()).save("wire.json")
            virtual = rates(engine, counter, rig, Path("wire.json"), EVENTS)
        with (
            served("--pty", f"{folder}/port") as (process, url),
            smadrive.open_rig(load_rig("simulated").at(url + PATIENT)) as rig,
        ):
            real = rates(engine, counter, rig, Path("wire.json"), 100)
            wire = SmaWire(rig, "wire.json")
            disarmed = Disarmed(process.stderr)
            aborts_s = [abort_s(engine, wire, disarmed) for _ in range(ABORTS)]
    print(f"{'events per second':<20}{'virtual':>9}{'real':>9}")
    for name, value in virtual.items():
        print(f"{name:<20}{value:>9.0f}{real[name]:>9.0f}")
    print(f"ophyd.sim           {_of_ophyd(engine, counter):>9}")
    for what, times_s in zip(("the board disarms", "the engine returns"), zip(*aborts_s, strict=True), strict=True):
        times = f"median {1e3 * median(times_s):.0f} ms, longest {1e3 * max(times_s):.0f} ms of {ABORTS}"
        print(f"abort until {what}: {times}, limit {1e3 * LIMIT_S:.0f} ms")


def _of_ophyd(engine: RunEngine, counter: Counter) -> str:
    try:
        from ophyd.sim import det
    except ImportError:
        return "missing"
    return f"{rate(engine, counter, bp.count([det], EVENTS)):.0f}"


if __name__ == "__main__":
    main()
