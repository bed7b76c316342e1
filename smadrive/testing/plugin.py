"""Fixtures for pytest: a rig on a simulated wire, in virtual time, and the faults of its devices.

pytest finds this plugin by itself where smadrive is installed. `sma_rig` is a connected `Rig`; `sma_faults` has a
method for every fault of the devices that simulate this rig. A marker selects the rig (by default in-process), the
simulated wire (flexinol-lt-0.15mm) and the seed of the sensors' noise (0); each part may be left out:

    @pytest.mark.sma(rig="my-rig.toml", sim="flexinol-lt-0.15mm", seed=7)

Every run of pytest imports this file. To keep this fast, only the first test that uses a fixture imports the rig and
the simulator.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from smadrive.rig.rig import Rig
    from smadrive.testing.simulated_faults import SimulatedFaults

RIG = "in-process"
SIM = "flexinol-lt-0.15mm"

PARTS = ("rig", "sim", "seed")
"""The parts of the marker `sma`."""


def pytest_configure(config: pytest.Config) -> None:
    """Register the marker `sma`."""
    config.addinivalue_line("markers", f"sma({', '.join(PARTS)}): selects the simulated rig of the fixture sma_rig.")


@pytest.fixture
def sma_faults(request: pytest.FixtureRequest) -> SimulatedFaults:
    """The faults of the simulated bench that `sma_rig` is connected to."""
    from smadrive.testing.simulated_faults import simulated_faults  # noqa: PLC0415

    parts = _marker_parts(request)
    return simulated_faults(parts.get("sim", SIM), parts.get("seed", 0))


@pytest.fixture
def sma_rig(request: pytest.FixtureRequest, sma_faults: SimulatedFaults) -> Iterator[Rig]:
    """A rig whose devices are simulated. Their addresses in the rig file have no effect.

    At the end of the test the rig enters its safe state.
    """
    from smadrive.rig.config import load_rig  # noqa: PLC0415
    from smadrive.testing.simulated_faults import rig_on  # noqa: PLC0415

    with rig_on(sma_faults, load_rig(_marker_parts(request).get("rig", RIG))) as rig:
        yield rig


def _marker_parts(request: pytest.FixtureRequest) -> dict[str, Any]:
    """Return the parts of the marker `sma`.

    ConfigError for a part without a name, and for an unknown part. Otherwise a spelling mistake would silently select
    the default.
    """
    from smadrive.errors import ConfigError  # noqa: PLC0415
    from smadrive.files.spelling import suggestion_or_list  # noqa: PLC0415

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
