"""The base class of the heat sources: a device that proves its identity, enters its safe state, and is armed."""

from __future__ import annotations

from typing import Generic, Protocol, TypeVar

from smadrive.devices.identity import Identity
from smadrive.devices.profile.profile import Profile


class SwitchableDevice(Protocol):
    """A device that proves its identity and can be switched off, such as a Device or a TCLabBoard."""

    @property
    def profile(self) -> Profile:
        """The profile of the device."""
        ...

    @property
    def identity(self) -> Identity:
        """The values of the registers that distinguish the device from others of its type."""
        ...

    def check_identity(self) -> object:
        """Prove the identity of the device."""
        ...

    def send_safe_state(self) -> None:
        """Send the safe state at once, without waiting for replies, if the device does not answer any more."""
        ...

    def enter_safe_state(self) -> None:
        """Write the safe state and confirm it by read-back."""
        ...


DeviceT = TypeVar("DeviceT", bound=SwitchableDevice)


class DeviceSource(Generic[DeviceT]):
    """A device as heat source; see HeatSource. Subclasses add `configure`, `arm`, `exchange` and `clear_faults`."""

    def __init__(self, device: DeviceT) -> None:
        """Nothing is sent yet."""
        self.device = device
        self.settle_s = device.profile.timing.settle_ms / 1e3
        self._armed = False

    @property
    def identity(self) -> Identity:
        """The values of the registers that distinguish the device from others of its type; empty before `connect`."""
        return self.device.identity

    @property
    def armed(self) -> bool:
        """True if the device was armed at every exchange since `arm`."""
        return self._armed

    def connect(self) -> None:
        """Prove the identity of the device and write its safe state."""
        self.device.check_identity()
        self.enter_safe_state()

    def send_safe_state(self) -> None:
        """Send the safe state at once, without waiting for replies, if the device does not answer any more."""
        self.device.send_safe_state()

    def forget_command(self) -> None:
        """Do nothing, because every exchange sends its command."""

    def enter_safe_state(self) -> None:
        """Disarm, set zero current and switch the output off, confirmed by read-back."""
        self._armed = False
        self.device.enter_safe_state()
