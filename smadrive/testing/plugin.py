"""Fixtures for pytest: a rig on a simulated wire, in virtual time, and the faults of its devices.

One line in your conftest.py makes them available:

    pytest_plugins = ["smadrive.testing.plugin"]

`sma_rig` is a connected `Rig`; `sma_faults` has a method for every fault of the devices that simulate this rig. A
marker selects the rig, the simulated wire and the seed of the sensors' noise; each part may be left out:

    @pytest.mark.sma(rig="my-rig.toml", sim="flexinol-lt-0.15mm", seed=7)
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import pytest

from firmware_sim.bench import SimulatedBench
from firmware_sim.config import load_sim
from smadrive.errors import ConfigError
from smadrive.files.spelling import suggestion_or_list
from smadrive.rig.config import load_rig
from smadrive.rig.rig import Rig
from smadrive.rig.simulation import SimulatedConnections

RIG = "in-process"
SIM = "flexinol-lt-0.15mm"

PARTS = ("rig", "sim", "seed")
"""The parts of the marker `sma`."""


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


def pytest_configure(config: pytest.Config) -> None:
    """Register the marker `sma`."""
    config.addinivalue_line("markers", f"sma({', '.join(PARTS)}): selects the simulated rig of the fixture sma_rig.")


@pytest.fixture
def sma_faults(request: pytest.FixtureRequest) -> SimulatedFaults:
    """The faults of the simulated bench that `sma_rig` is connected to."""
    parts = _marker_parts(request)
    return SimulatedFaults(SimulatedBench(load_sim(parts.get("sim", SIM)), parts.get("seed", 0)))


@pytest.fixture
def sma_rig(request: pytest.FixtureRequest, sma_faults: SimulatedFaults) -> Iterator[Rig]:
    """A rig whose devices are simulated, whatever their addresses in the rig file are.

    At the end of the test the rig enters its safe state.
    """
    config = load_rig(_marker_parts(request).get("rig", RIG))
    connections = SimulatedConnections(sma_faults.bench)
    transports = {device.name: connections.transport(device) for device in config.devices}
    with Rig(config, transports=transports) as rig:
        yield rig


def _marker_parts(request: pytest.FixtureRequest) -> dict[str, Any]:
    """Return the parts of the marker `sma`.

    ConfigError for a part without a name, and for an unknown part: after a spelling mistake, the default must not be
    used silently.
    """
    marker: pytest.Mark | None = request.node.get_closest_marker("sma")
    if marker is None:
        return {}
    if marker.args:
        raise ConfigError(
            f"{marker.args[0]!r} has no name", where="marker 'sma'", cure="write rig=, sim= or seed= before it"
        )
    for name in marker.kwargs:
        if name not in PARTS:
            raise ConfigError(f"unknown part '{name}'", where="marker 'sma'", cure=suggestion_or_list(name, PARTS))
    return dict(marker.kwargs)
