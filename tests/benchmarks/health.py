"""False alarms and found jumps of the resistance, and the drift that a record shows: python tests/benchmarks/health.py

Every wire is random, and so is its resistance. It is excited and identified like a real wire. Then it runs healthy,
with and without a displacement sensor, in drafts, drifting ambient temperatures and steps of the load, while it ages
and its contacts change a little from run to run. Each run adds an entry to the record of the wire, like `smadrive run`.
A healthy run must not trip. Afterwards, each kind of jump is tried in a run of its own, from the same record.
"""

from __future__ import annotations

import argparse
import os
import tempfile
from collections import Counter
from contextlib import contextmanager
from functools import partial
from itertools import product
from pathlib import Path
from random import Random

from firmware_sim.bench import simulated_device
from firmware_sim.config import SimConfig, load_sim
from firmware_sim.physics.random_wire import random_wire
from smadrive.clock import VirtualClock
from smadrive.control.references.shapes import sine
from smadrive.errors import SmadriveError, TripError
from smadrive.identification.wire import FitSettings
from smadrive.rig.config import load_rig
from smadrive.rig.rig import Rig
from smadrive.runs.experiments import excite, plan_excitation, track
from smadrive.runs.health.assessment import assess, expected_of
from smadrive.runs.health.recording import record_health
from smadrive.runs.record_fit import fit_file
from smadrive.runs.tracking_plan import plan_tracking
from smadrive.wire.health.record import health_file
from smadrive.wire.identified_wire import load_wire
from smadrive.wire.wire_model import travel_mm

RIG = load_rig("in-process")
NOMINAL = load_sim("flexinol-lt-0.15mm")
CALM, SHARE = "calm", 0.01
"""A healthy contact changes the resistance by up to this share from run to run."""

HEALTHY = {
    CALM: lambda _plant, **_: None,
    "draft": lambda plant, random: plant.surroundings.draft(random.uniform(1.0, 1.6), for_s=20.0),
    "ambient": lambda plant, random: plant.surroundings.drift_ambient(random.uniform(-8.0, 8.0), over_s=60.0),
    "load": lambda plant, random: plant.load.step_load(random.uniform(-60.0, 60.0)),
}
CRACKS = {f"crack +{100 * share:.0f} %": share for share in (0.05, 0.1, 0.2)}
OTHER = "another wire"


class WireUnderTest:
    """A random wire, its files in `folder`, and its age."""

    def __init__(self, folder: Path, seed: int) -> None:
        self.random = Random(seed)
        self.seed, self.folder, self.wire_file = seed, folder, folder / "wire.json"
        self.sim = random_wire(NOMINAL, seed)
        self.contact_ohm = self.shift_c = self.fade = 0.0
        self.runs = 0

    def rig(self, sim: SimConfig, *, sensor: bool):
        """Return a new rig with the wire at its present age, and its plant."""
        self.runs += 1
        sim = sim if sensor else sim.model_copy(update={"displacement": None})
        device, clock = simulated_device(sim, seed=100 * self.seed + self.runs), VirtualClock()
        clock.follow(device.bench.advance_to)
        plant = device.bench.plant
        plant.ageing.age_wire(self.shift_c, 0.01, self.fade)
        self.contact_ohm = sim.wire.resistance_cold_ohm * self.random.uniform(0.0, SHARE)
        plant.faults.corrode_contact(self.contact_ohm)
        return Rig(RIG, transports={"board": device.transport(clock)}), plant

    def identify(self) -> None:
        log_file, (rig, _) = self.folder / "excitation.h5", self.rig(self.sim, sensor=True)
        with rig as opened:
            excite(log_file, opened, plan_excitation(opened), watched(lambda _time_s: None))
        settings = FitSettings("tsfuzzy", 11, 1, 1)
        fit_file(log_file, ("temperature_c", "displacement_mm"), settings).wire(str(log_file)).save(self.wire_file)

    def run(self, act, *, sim: SimConfig | None = None, sensor: bool = True, at_s: float = 0.0) -> TripError | None:
        """Track a random sine, and call `act` with the plant at `at_s`. Add the run to the record; return its trip."""
        identified, random = load_wire(self.wire_file), self.random
        cold_mm, hot_mm = travel_mm(identified.model)
        low, high = random.uniform(0.1, 0.4), random.uniform(0.6, 0.85)
        ends = {"low_mm": cold_mm + low * (hot_mm - cold_mm), "high_mm": cold_mm + high * (hot_mm - cold_mm)}
        reference = sine(period_s=random.uniform(40.0, 70.0), cycles=1.5, **ends)
        log_file, (rig, plant) = self.folder / f"run{self.runs}.h5", self.rig(sim or self.sim, sensor=sensor)
        waiting = [at_s]

        def on_tick(time_s: float) -> None:
            if waiting and time_s >= waiting[0]:
                waiting.clear()
                act(plant)

        try:
            with rig as opened:
                plan = plan_tracking(opened, reference, identified, smooth=True, smooth_option="")
                track(log_file, opened, plan, watched(on_tick))
        except TripError as trip:
            return trip
        finally:
            for caveat in record_health(log_file):
                print(caveat)
        return None


def watched(on_tick):
    @contextmanager
    def watch(recorder, _duration_s):
        def record(tick):
            on_tick(tick.time_s)
            recorder.tick(tick)

        yield record

    return watch


def healthy_runs(wire: WireUnderTest, runs: int, kelvin: float, fade: float) -> Counter:
    """Return the number of runs, and of their trips by the number of the fault, while the wire ages."""
    counts, random = Counter(), wire.random
    for run in range(runs):
        wire.shift_c, wire.fade = kelvin * run / runs, fade * run / runs
        name, sensor = random.choice(list(HEALTHY)), random.random() < 0.6
        disturb = partial(HEALTHY[name], random=random)
        trip = wire.run(disturb, sensor=sensor, at_s=random.uniform(10.0, 60.0))
        counts["runs"] += 1
        if trip is not None:
            counts[f"fault {trip.number}"] += 1
            print(f"wire {wire.seed}, {name}, {'with' if sensor else 'without'} sensor: {trip}")
    return counts


def crack(plant, wire: WireUnderTest, share: float) -> None:
    """Add this share of the wire's resistance to its contacts."""
    plant.faults.corrode_contact(wire.contact_ohm + share * wire.sim.wire.resistance_cold_ohm)


def jumping_runs(wire: WireUnderTest) -> Counter:
    """Return the number of runs for each (kind of jump, sensor, number of the fault that ended the run)."""
    counts, record = Counter(), health_file(wire.wire_file)
    before = record.read_bytes()
    jumps = {name: (partial(crack, wire=wire, share=share), wire.sim) for name, share in CRACKS.items()}
    jumps[OTHER] = (lambda _plant: None, random_wire(NOMINAL, wire.seed + 500))
    for name, (act, sim) in jumps.items():
        sensor = wire.random.random() < 0.5
        trip = wire.run(act, sim=sim, sensor=sensor, at_s=wire.random.uniform(20.0, 40.0))
        record.write_bytes(before)
        counts[name, sensor, 0 if trip is None else trip.number] += 1
    return counts


def study(wires: int, runs: int, seed: int, kelvin: float, fade: float) -> None:
    """Print the trips of healthy runs, the jumps that were found, and the drift that the record shows at the end."""
    found, healthy = Counter(), Counter()
    for number in range(seed, seed + wires):
        with tempfile.TemporaryDirectory() as folder:
            wire = WireUnderTest(Path(folder), number)
            try:
                wire.identify()
            except SmadriveError as error:
                print(f"wire {number}: not identified: {error}")
                continue
            healthy += healthy_runs(wire, runs, kelvin, fade)
            identified = load_wire(wire.wire_file)
            expected = expected_of(identified)
            health = assess(wire.wire_file, RIG.feedback).health
            found += jumping_runs(wire)
            print(f"wire {number}: tolerance {100 * expected.tolerance:.1f} %; {health!s}", flush=True)
    print(f"\nhealthy: {dict(healthy)}")
    print(f"{'jump':16}{'sensor':10}found by fault 20   by fault 21   by another fault   not found")
    for name, sensor in product([*CRACKS, OTHER], (True, False)):
        of = {fault: count for (jump, has, fault), count in found.items() if (jump, has) == (name, sensor)}
        missed, jumped, implausible = (of.pop(number, 0) for number in (0, 20, 21))
        of_sensor = f"{name:16}{'with' if sensor else 'without':10}"
        print(f"{of_sensor}{jumped:17}{implausible:14}{sum(of.values()):19}{missed:12}")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--wires", type=int, default=25)
    parser.add_argument("--runs", type=int, default=8, help="healthy runs of each wire")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--kelvin", type=float, default=1.0, help="shift of the loop over these runs, by ageing")
    parser.add_argument("--fade", type=float, default=0.02, help="fade of the stroke over these runs, as a share")
    arguments = parser.parse_args()
    os.nice(5)
    study(**vars(arguments))
