"""The common part of the heat sources that are controlled by Modbus registers: heater board and bench supply."""

from __future__ import annotations

from smadrive.devices.device import Device
from smadrive.devices.identity import Identity


class RegisterSource:
    """A Device as heat source; see HeatSource. A subclass has the exchange and the limits."""

    def __init__(self, device: Device) -> None:
        """Send nothing yet."""
        self.device = device
        self.settle_s = device.profile.timing.settle_ms / 1e3
        self._armed = False

    @property
    def identity(self) -> Identity:
        """See HeatSource."""
        return self.device.identity

    @property
    def armed(self) -> bool:
        """True if the device was armed at every exchange since `arm`."""
        return self._armed

    def connect(self) -> None:
        """Prove the identity of the device and write its safe state."""
        self.device.check_identity()
        self.enter_safe_state()

    def enter_safe_state(self) -> None:
        """See HeatSource."""
        self._armed = False
        self.device.enter_safe_state()
