"""The interfaces between a simulated device and its firmware."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple, Protocol

from firmware_sim.devices.registers import Quantity


class Firmware(Protocol):
    """The program of a device: it reads its sensors and sets the current."""

    @property
    def current_a(self) -> float:
        """The current that the device tries to drive through the wire."""
        ...

    @property
    def voltage_max_v(self) -> float:
        """The highest voltage of the device's output."""
        ...

    def restart(self) -> None:
        """Return to the power-up state."""
        ...

    def tick(self, dt_s: float) -> None:
        """Run for `dt_s`."""
        ...


class RegisterFirmware(Firmware, Protocol):
    """A firmware that gets and returns the values of registers by role. It does not know the register map."""

    def check(self, values: Mapping[str, float]) -> None:
        """Raise ModbusException when the firmware rejects a write. `values` has the values to write by role."""
        ...

    def write(self, values: Mapping[str, float]) -> None:
        """Carry out a write request. `values` has the written values by role."""
        ...

    def quantities(self) -> Mapping[str, Quantity]:
        """Return the values that the registers show, by role. None marks a missing reading."""
        ...


class RequestHandler(Protocol):
    """The server side of a device's protocol."""

    def answer(self, pdu: bytes) -> bytes:
        """Carry out a request, and return the PDU of the reply."""
        ...


class OwnSerialLine(Protocol):
    """The serial line of a device that reads the bytes of the line itself."""

    def exchange(self, data: bytes) -> list[tuple[float, bytes]]:
        """Send `data` to the device, and return its replies as pairs (time of the last byte in s, frame)."""
        ...


class DeviceParts(NamedTuple):
    """The firmware of a device, and the handler of its requests.

    Without `serial_line`, the simulator finds the requests in the bytes of the line.
    """

    firmware: Firmware
    responder: RequestHandler
    serial_line: OwnSerialLine | None = None
