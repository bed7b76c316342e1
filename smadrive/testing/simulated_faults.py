"""The faults of a simulated bench, by their names."""

from __future__ import annotations

from collections.abc import Callable

from firmware_sim.bench import SimulatedBench
from firmware_sim.config import load_sim
from smadrive.errors import ConfigError
from smadrive.files.spelling import suggestion_or_list
from smadrive.rig.config import RigConfig
from smadrive.rig.rig import Rig
from smadrive.rig.simulation import SimulatedConnections


class SimulatedFaults:
    """The faults of a simulated bench as methods; `bench` holds the true state of wire and devices.

    faults.open_thermocouple()              a fault of the wire or its sensors
    faults["board.drop"](replies=3)         a fault on the bus of the device 'board'
    """

    def __init__(self, bench: SimulatedBench) -> None:
        self.bench = bench

    def __getitem__(self, name: str) -> Callable[..., None]:
        known = self.bench.known_faults()
        if name not in known:
            raise ConfigError(f"no fault has the name '{name}'", cure=suggestion_or_list(name, known))
        return known[name]

    def __getattr__(self, name: str) -> Callable[..., None]:
        try:
            return self[name]
        except ConfigError as error:
            raise AttributeError(str(error)) from None


def simulated_faults(sim: str, seed: int) -> SimulatedFaults:
    """Return the faults of a new bench with the simulated wire `sim`."""
    return SimulatedFaults(SimulatedBench(load_sim(sim), seed))


def rig_on(faults: SimulatedFaults, config: RigConfig) -> Rig:
    """Return the rig of `config`, connected to the simulated devices of `faults`. Its `url` keys have no effect."""
    return Rig(config, transports=SimulatedConnections(faults.bench).transports(config.devices))
