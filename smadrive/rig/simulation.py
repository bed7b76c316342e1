"""Simulated devices in this process and in virtual time. They serve sim:// addresses and the test fixtures."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from smadrive.clock import VirtualClock
from smadrive.devices.profile.profile import load_profile
from smadrive.modbus.transports.transport import Transport
from smadrive.rig.config import DeviceConfig

if TYPE_CHECKING:
    from firmware_sim.bench import SimulatedBench


class SimulatedConnections:
    """Connections to the devices of one simulated bench. All use one virtual clock, which drives the bench."""

    def __init__(self, simulated_bench: SimulatedBench) -> None:
        self._simulated_bench = simulated_bench
        self._clock = VirtualClock()
        self._clock.follow(simulated_bench.advance_to)

    def transport(self, device: DeviceConfig, profile: str = "") -> Transport:
        """Attach the device to the bench and return a connection to it.

        `profile` replaces the profile in the rig file unless it is empty.
        """
        attached = self._simulated_bench.attach(load_profile(profile or device.profile), device.unit_id, device.name)
        return attached.transport(self._clock)

    def transports(self, devices: Iterable[DeviceConfig]) -> dict[str, Transport]:
        """Attach the devices to the bench and return the connections to them by the name of the device."""
        return {device.name: self.transport(device) for device in devices}


def simulate(sim: str) -> SimulatedConnections:
    """Return the connections to a new simulated bench. `sim` is the path or the shipped name of a simulation file.

    Only this function imports the simulator.
    """
    from firmware_sim.bench import SimulatedBench  # noqa: PLC0415
    from firmware_sim.config import load_sim  # noqa: PLC0415

    return SimulatedConnections(SimulatedBench(load_sim(sim)))
