"""The rig of one run: its random wire, its simulated devices, and the faults that begin during the run.

The addresses in the rig file have no effect: all devices are simulated in this process, in virtual time. No port is
opened, and no state is kept.
"""

from __future__ import annotations

from random import Random

from firmware_sim.bench import SimulatedBench
from firmware_sim.config import SimConfig
from firmware_sim.fault_script import FaultEntry, FaultScript, scheduled
from firmware_sim.physics.random_wire import random_wire
from smadrive.campaigns.experiments.columns import Row
from smadrive.campaigns.plan.config import DisturbanceConfig
from smadrive.campaigns.plan.documents import changed_sim
from smadrive.campaigns.plan.plan import PlannedRun
from smadrive.control.references.reference import Reference
from smadrive.errors import ConfigError
from smadrive.rig.rig import Rig
from smadrive.rig.simulation import SimulatedConnections

EXCITATION, TRACKING = 0, 1
"""The parts of a run. Each part has its own noise."""


def simulated_wire(run: PlannedRun) -> SimConfig:
    """Return the simulated wire of a run: the nominal wire or, with `wire.seed`, a random wire around it.

    The changes in [run.sim] also apply to the random wire.
    """
    wire, sim = run.settings.wire, run.documents.sim
    if wire.seed is None:
        return sim
    return changed_sim(random_wire(sim, wire.seed, wire.kind), run.settings.sim)


def tracked_wire(run: PlannedRun) -> SimConfig:
    """Return the simulated wire while it tracks: with or without a displacement sensor, as the run decides."""
    sim = simulated_wire(run)
    return sim if run.settings.displacement_sensor else sim.model_copy(update={"displacement": None})


def wire_row(sim: SimConfig) -> Row:
    """Return the true parameters of the simulated wire."""
    wire, transformation = sim.wire, sim.transformation
    branches = ("mu_heating_c", "mu_cooling_c", "sigma_heating_c", "sigma_cooling_c")
    heat = ("stroke_mm", "heat_capacity_j_per_k", "loss_w_per_k", "latent_heat_j_per_kg", "resistance_cold_ohm")
    return {
        "wire_kind": transformation.kind,
        **{name: getattr(wire, name) for name in heat},
        "thermocouple_lag_s": sim.thermocouple.lag_s,
        **{name: getattr(transformation, name) for name in branches},
    }


def noise_seed(run: PlannedRun, part: int) -> int:
    """Return the seed of the noise in a part of a run.

    Runs with the same wire and the same `seed` have the same noise, so they differ only by their settings.
    """
    return Random(f"{run.settings.seed} {run.settings.wire.seed} {part}").getrandbits(32)


class SimulatedRig:
    """The rig of a run on its simulated wire. `simulated_bench` has the true state of the wire."""

    def __init__(self, run: PlannedRun, sim: SimConfig, part: int) -> None:
        self._seed = noise_seed(run, part)
        self.simulated_bench = SimulatedBench(sim, self._seed)
        transports = SimulatedConnections(self.simulated_bench).transports(run.documents.rig.devices)
        self.rig = Rig(run.documents.rig, transports=transports, data_sheet=run.documents.data_sheet)

    def plan_disturbance(self, disturbance: tuple[DisturbanceConfig, ...], reference: Reference) -> None:
        """Plan the faults of a disturbance. ConfigError for an unknown fault, or one after the end of the reference.

        The times of the faults count from the end of the approach, and the run begins now. A random time is drawn with
        the seed of the noise.
        """
        _check_times(disturbance, reference)
        random, begins_s = Random(self._seed), self.simulated_bench.time_s + reference.scored_from_s
        entries = (_entry(one, begins_s, random) for one in disturbance)
        self.simulated_bench.follow_script(FaultScript(faults=tuple(entries)))


def check_disturbance(run: PlannedRun, reference: Reference) -> None:
    """Raise ConfigError if a fault of the run is unknown, has unknown parameters, or comes after the reference.

    The rig need not be possible.
    """
    _check_times(run.disturbance, reference)
    simulated_bench = SimulatedBench(run.documents.sim, 0)
    SimulatedConnections(simulated_bench).transports(run.documents.rig.devices)
    script = FaultScript(faults=tuple(_entry(one, 0.0, Random(0)) for one in run.disturbance))
    scheduled(script, simulated_bench.known_faults())


def _check_times(disturbance: tuple[DisturbanceConfig, ...], reference: Reference) -> None:
    """Raise ConfigError if a fault may begin after the end of the reference, where it would have no effect."""
    lasts_s = reference.duration_s - reference.scored_from_s
    for one in disturbance:
        if one.latest_s >= lasts_s:
            raise ConfigError(
                "may begin after the end of the reference, without an effect",
                where=f"disturbance '{one.name}'",
                value=f"{one.latest_s:g} s",
                limit=f"less than {lasts_s:g} s, which counts from the end of the approach",
                cure="let it begin earlier, or give a longer reference",
            )


def _entry(disturbance: DisturbanceConfig, begins_s: float, random: Random) -> FaultEntry:
    at_s = disturbance.at_s
    if disturbance.between_s is not None:
        at_s = random.uniform(*disturbance.between_s)
    assert at_s is not None
    return FaultEntry(at_s=begins_s + at_s, name=disturbance.name, **(disturbance.model_extra or {}))
