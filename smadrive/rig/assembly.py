"""Opens the devices of a rig according to its plan (plan.py). Devices with the same address share a connection."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import ExitStack
from math import inf
from pathlib import Path
from typing import NamedTuple

from smadrive.clock import Clock
from smadrive.devices.device import Device
from smadrive.devices.guardian.client import GuardianClient
from smadrive.devices.heater import Heater
from smadrive.devices.heating.board import HeaterBoard
from smadrive.devices.heating.heat_source import HeatSource
from smadrive.devices.heating.supply import BenchSupply
from smadrive.devices.heating.tclab import TCLab
from smadrive.devices.heating.tclab_board import TCLabBoard
from smadrive.devices.sensor import PolledSensor
from smadrive.devices.state.key import DeviceKey
from smadrive.devices.stopping.listener import StopListener
from smadrive.modbus.transports.transport import Transport
from smadrive.rig.connections import Connections, key_of
from smadrive.rig.plan import RigPlan
from smadrive.rig.planned_device import PlannedDevice


class RigDevices(NamedTuple):
    """The open devices of a rig.

    heater      the heater with its sensors
    by_name     every device, by its name
    clock       the clock that all devices share
    source      the device that heats
    port_key    key of the source without its serial number; None for a simulated device
    """

    heater: Heater
    by_name: Mapping[str, Device | TCLabBoard]
    clock: Clock
    source: Device | TCLabBoard
    port_key: DeviceKey | None

    def key(self) -> DeviceKey | None:
        """Return the key of the device that heats, with its proved identity. Return None for a simulated device."""
        if self.port_key is None:
            return None
        return self.port_key.with_identity(self.source.profile, self.source.identity)


def open_devices(
    plan: RigPlan,
    stack: ExitStack,
    stop: StopListener,
    clock: Clock | None,
    transports: Mapping[str, Transport],
    trace_folder: Path | None = None,
) -> RigDevices:
    """Open the devices of the plan without sending a request. `stack` closes the devices.

    stop            listens for an emergency stop at every line that is locked
    transports      connections by device name, used instead of the addresses in the rig file
    clock           clock to use instead of the clock of the connections
    trace_folder    folder for traces of the traffic, one file for each connection
    BusyError when another process uses a line; ConfigError when a trace file cannot be written; TransportError when a
    port cannot be opened.
    """
    connections = Connections(stack, trace_folder, stop=stop)
    guard = _guard(plan, connections)
    devices = {
        device.name: connections.device(device, transports.get(device.name), None if device is plan.source else 0)
        for device in plan.devices
    }
    if guard is not None:
        guard.share(connections.locks_of(plan.source))
        stack.enter_context(guard)
    source = devices[plan.source.name]
    clock = clock or source.clock
    sensors = _sensors(plan, devices, clock)
    heater = Heater(
        heat_source(plan.source, source, clock, plan.answers_within_s),
        plan.limits,
        clock,
        sensors.get("temperature"),
        sensors.get("displacement"),
        guard,
        stop,
        plan.corrections,
        plan.source.source_measures,
    )
    return RigDevices(heater, devices, clock, source, port_key(plan.source))


def heat_source(
    planned: PlannedDevice, device: Device | TCLabBoard, clock: Clock, answers_within_s: float = inf
) -> HeatSource:
    """Return the open device as a heat source.

    answers_within_s    time in s within which an armed supply must answer again; see BenchSupply

    `check_full_scales` checks the full scales before a run. `off` does not read them: no current is no current at every
    scale.
    """
    if isinstance(device, Device):
        if planned.source_type is HeaterBoard:
            return HeaterBoard(device, clock)
        return BenchSupply(device, answers_within_s)
    return TCLab(device, planned.config.full_scale_a or 1.0, planned.config.full_scale_v or 1.0)


def port_key(device: PlannedDevice) -> DeviceKey | None:
    """Return the key of the device, without its serial number; None for a simulated device, which has no port."""
    if device.is_simulated:
        return None
    return key_of(device)


def _guard(plan: RigPlan, connections: Connections) -> GuardianClient | None:
    """Return the client of the guardian; None if the plan has no guardian.

    Each use of a connection sends the guardian a heartbeat.
    """
    if plan.guardian is None:
        return None
    guard = GuardianClient(plan.guardian, connections.disconnect)
    connections.access = guard.heartbeat
    return guard


def _sensors(plan: RigPlan, devices: Mapping[str, Device | TCLabBoard], clock: Clock) -> dict[str, PolledSensor]:
    sensors = {}
    for sensor in plan.sensors:
        device = devices[sensor.device.name]
        assert isinstance(device, Device)  # only the heat source can be a TCLabBoard
        neighbours = [
            other
            for other in devices.values()
            if isinstance(other, Device) and other is not device and other.client is device.client
        ]
        settings = sensor.quantity, sensor.period_s, sensor.stale_s, clock
        sensors[sensor.quantity] = PolledSensor(device, *settings, neighbours)
    return sensors
