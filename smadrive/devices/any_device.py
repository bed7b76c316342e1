"""Any device of a rig, whatever it speaks: what a rig and the guardian need of it, and where it is made."""

from __future__ import annotations

from typing import Protocol

from smadrive.clock import Clock
from smadrive.devices.device import Device
from smadrive.devices.heating.tclab import TCLabBoard
from smadrive.devices.identity import UNKNOWN, Identity, Proof
from smadrive.devices.profile.profile import Profile
from smadrive.modbus.client import ModbusClient
from smadrive.modbus.transports.transport import Transport


class AnyDevice(Protocol):
    """A device that can prove who it is and be brought to its safe state."""

    @property
    def profile(self) -> Profile:
        """What is known of its type."""
        ...

    @property
    def clock(self) -> Clock:
        """The clock of its deadlines."""
        ...

    @property
    def identity(self) -> Identity:
        """What tells it from its twins, once it has been proved; empty where nothing does."""
        ...

    @property
    def proof(self) -> Proof:
        """What its answers have proved of its type up to now."""
        ...

    def check_identity(self) -> None:
        """Prove that it is what `profile` describes; IdentityError if not."""
        ...

    def enter_safe_state(self) -> None:
        """End all heating, confirmed by read-back; tried several times, raises when unconfirmed."""
        ...


def device_on(transport: Transport, profile: Profile, unit_id: int | None, identity: Identity = UNKNOWN) -> AnyDevice:
    """The device of this profile, alone on a connection; the one of this `identity`, where it has one."""
    if profile.has_registers:
        return Device(profile, ModbusClient(transport), unit_id, identity=identity)
    return TCLabBoard(profile, transport)
