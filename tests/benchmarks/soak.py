"""Hours of continuous tracking in virtual time: python tests/benchmarks/soak.py [--hours 24] [--rig in-process]

A random wire is excited, identified and then tracked without a pause, with sines of three periods in turn. Every tick
passes the full register codec of the rig's devices and goes into a log. Each simulated hour prints a line: the tracking
error, lost exchanges, trips, and the memory of the process. Neither memory nor error may grow, no deadline may be
missed, and the last hour must equal the first within noise.
"""

from __future__ import annotations

import argparse
import resource
import tempfile
import time
from pathlib import Path

import numpy as np

from firmware_sim.bench import SimulatedBench
from firmware_sim.config import load_sim
from firmware_sim.physics.random_wire import random_wire
from smadrive.clock import VirtualClock
from smadrive.control.feedforward.displacement import HysteresisInverse
from smadrive.control.references.reference import Reference
from smadrive.devices.profile.profile import load_profile
from smadrive.identification.wire import identify_wire
from smadrive.rig.config import load_rig
from smadrive.rig.rig import Rig
from smadrive.runs.log.reader import read_log
from smadrive.runs.run_log import record_excitation, record_tracking
from smadrive.runs.run_metadata import excitation_record
from smadrive.wire.wire_model import WireModel, travel_mm

HOUR_S = 3600.0
PERIODS_S = (40.0, 56.0, 90.0)
APPROACH_S = 10.0


def endless(cold_mm: float, hot_mm: float, duration_s: float) -> Reference:
    """Return sines over the middle of the stroke for `duration_s`, six minutes of each period in turn."""
    times_s = np.arange(0.0, duration_s, 0.5)
    period_s = np.asarray(PERIODS_S)[(times_s // 360.0).astype(int) % len(PERIODS_S)]
    phase = np.cumsum(np.concatenate(([0.0], np.diff(times_s) / period_s[1:])))
    middle_mm, half_mm = 0.5 * (cold_mm + hot_mm), 0.3 * (hot_mm - cold_mm)
    return Reference.from_samples(times_s, middle_mm - half_mm * np.cos(2.0 * np.pi * phase))


def memory_mb() -> float:
    """Return the present memory of this process in MB."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * resource.getpagesize() / 1e6


def main() -> None:
    """Run, and print a line for every hour."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--hours", type=float, default=24.0)
    parser.add_argument("--rig", default="in-process", help="the rig whose devices, limits and rate are used")
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    config = load_rig(arguments.rig)
    bench = SimulatedBench(random_wire(load_sim("flexinol-lt-0.15mm"), arguments.seed), arguments.seed)
    clock = VirtualClock()
    clock.follow(bench.advance_to)
    transports = {
        device.name: bench.attach(load_profile(device.profile), name=device.name).transport(clock)
        for device in config.devices
    }
    with tempfile.TemporaryDirectory() as folder, Rig(config, transports=transports) as rig:
        path = Path(folder)
        excitation = rig.excitation(rig.heater.exchange(0.0).temperature_c)
        with record_excitation(path / "excitation.h5", rig, excitation) as recorder:
            rig.excite(excitation, recorder.tick)
        wire = identify_wire(excitation_record(read_log(path / "excitation.h5")), rig.nominal_balance)
        model = wire.hysteresis.model
        rig.cool_down(20.0)
        cold_mm, hot_mm = travel_mm(model)
        reference = endless(cold_mm, hot_mm, arguments.hours * HOUR_S).with_approach(cold_mm, APPROACH_S)
        experiment = reference, WireModel(model, wire.thermal.balance), HysteresisInverse(model)
        print(f"{'hour':>5}{'ticks':>9}{'RMS %':>8}{'max %':>8}{'memory MB':>11}{'x real time':>13}")
        errors_percent: list[float] = []
        begun_s = time.perf_counter()
        with record_tracking(path / "soak.h5", rig, *experiment) as recorder:

            def record(tick) -> None:
                nonlocal begun_s
                recorder.tick(tick)
                if tick.time_s >= APPROACH_S:
                    error_mm = tick.command.setpoint_mm - bench.plant.displacement_mm
                    errors_percent.append(100.0 * error_mm / (hot_mm - cold_mm))
                if len(errors_percent) == int(HOUR_S * config.rate_hz):
                    rms, most = np.sqrt(np.mean(np.square(errors_percent))), np.max(np.abs(errors_percent))
                    speed = HOUR_S / (time.perf_counter() - begun_s)
                    hour = round(tick.time_s / HOUR_S)
                    line = f"{hour:5}{len(errors_percent):9}{rms:8.3f}{most:8.3f}{memory_mb():11.1f}{speed:13.0f}"
                    print(line, flush=True)
                    errors_percent.clear()
                    begun_s = time.perf_counter()

            loop = rig.track(*experiment, record)
    print(f"{loop.ticks} ticks, {loop.lost_exchanges} lost, {loop.missed_deadlines} missed, {loop.trips} trips")


if __name__ == "__main__":
    main()
