"""Fixtures for pytest: a rig on a simulated wire, in virtual time, and everything that can go wrong with it.

One line in your conftest.py brings them into your tests:

    pytest_plugins = ["smadrive.testing.plugin"]

`sma_rig` is a connected `Rig`; `sma_faults` has a method for every fault of its simulated devices. Which rig, which
simulated wire and which seed a test gets is said by a marker, all parts of which may be left out:

    @pytest.mark.sma(rig="my-rig.toml", sim="flexinol-lt-0.15mm", seed=7)
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import pytest

from firmware_sim.bench import SimulatedBench
from firmware_sim.config import load_sim
from smadrive.errors import ConfigError
from smadrive.files.spelling import nearest
from smadrive.rig.config import load_rig
from smadrive.rig.rig import Rig
from smadrive.rig.simulation import SimulatedConnections

RIG = "in-process"
SIM = "flexinol-lt-0.15mm"

PARTS = ("rig", "sim", "seed")
"""What the marker can say."""


class SimulatedFaults:
    """The faults of a simulated bench as methods; `bench` itself tells what is really the case.

    faults.open_thermocouple()              what befalls the wire and its sensors
    faults["board.drop"](replies=3)         what befalls the bus of a device, which stands before it by its name
    """

    def __init__(self, bench: SimulatedBench) -> None:
        self.bench = bench

    def __getitem__(self, name: str) -> Callable[..., None]:
        known = self.bench.known_faults()
        if name not in known:
            raise ConfigError(f"no fault is called '{name}'{nearest(name, known)}")
        return known[name]

    def __getattr__(self, name: str) -> Callable[..., None]:
        try:
            return self[name]
        except ConfigError as error:
            raise AttributeError(str(error)) from None


def pytest_configure(config: pytest.Config) -> None:
    """Make the marker known."""
    config.addinivalue_line("markers", f"sma({', '.join(PARTS)}): which simulated rig the fixture sma_rig is.")


@pytest.fixture
def sma_faults(request: pytest.FixtureRequest) -> SimulatedFaults:
    """Everything that can be done to the simulated bench that `sma_rig` is connected to."""
    said = _said(request)
    return SimulatedFaults(SimulatedBench(load_sim(said.get("sim", SIM)), said.get("seed", 0)))


@pytest.fixture
def sma_rig(request: pytest.FixtureRequest, sma_faults: SimulatedFaults) -> Iterator[Rig]:
    """A rig, connected to simulated devices whatever addresses its file names; in its safe state when the test ends."""
    config = load_rig(_said(request).get("rig", RIG))
    connections = SimulatedConnections(sma_faults.bench)
    transports = {device.name: connections.transport(device) for device in config.devices}
    with Rig(config, transports=transports) as rig:
        yield rig


def _said(request: pytest.FixtureRequest) -> dict[str, Any]:
    """What the marker says; ConfigError for what it cannot say, lest a misspelt rig be the default one."""
    marker: pytest.Mark | None = request.node.get_closest_marker("sma")
    if marker is None:
        return {}
    if marker.args:
        raise ConfigError(f"marker 'sma': {marker.args[0]!r} has no name; write rig=, sim= or seed= before it")
    for name in marker.kwargs:
        if name not in PARTS:
            raise ConfigError(f"marker 'sma': unknown part '{name}'{nearest(name, PARTS)}")
    return dict(marker.kwargs)
