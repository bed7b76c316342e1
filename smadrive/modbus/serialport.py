"""A serial port as a transport: pyserial opens and sets the port."""

from __future__ import annotations

import errno
import termios
from contextlib import suppress

import serial
from serial.tools import list_ports

from smadrive.errors import TransportError
from smadrive.modbus.descriptor import DescriptorTransport
from smadrive.modbus.framing import RtuFraming
from smadrive.modbus.transport import SerialSettings


class SerialTransport(DescriptorTransport):
    """An open serial port; `exclusive`: for this process alone (a second smadrive is refused)."""

    end = "the port is readable and has no data"
    suspicion = "is the adapter plugged in and the device powered?"

    def __init__(self, port: str, settings: SerialSettings, *, exclusive: bool = True) -> None:
        """Open `port`; TransportError tells whether it is missing, busy or forbidden, and the cure."""
        self._settings = settings
        self._exclusive = exclusive
        super().__init__(port, RtuFraming(), settings.baudrate, timeout_s=0.0)

    def _channel(self, _timeout_s: float) -> serial.Serial:
        """The port; it opens at once or not at all."""
        try:
            port = serial.Serial(
                self.name,
                baudrate=self._settings.baudrate,
                parity=self._settings.parity,
                stopbits=self._settings.stopbits,
                timeout=0,
                exclusive=True if self._exclusive else None,
            )
        except (
            serial.SerialException,
            termios.error,
            OSError,
            ValueError,
        ) as error:  # a port that vanishes while it opens
            raise TransportError(_cure(self.name, error)) from None
        with suppress(ValueError, OSError, AttributeError):  # USB adapters then deliver after 1 ms, not after 16
            port.set_low_latency_mode(True)
        return port


def _cure(port: str, error: Exception) -> str:
    """Why `port` does not open, and what to do about it."""
    code = getattr(error, "errno", None)
    if code == errno.ENOENT:
        present = ", ".join(sorted(found.device for found in list_ports.comports())) or "none"
        return f"{port}: no such port; serial ports present: {present}: is the adapter plugged in?"
    if code in (errno.EACCES, errno.EPERM):
        return f"{port}: not permitted; join the group that owns it: sudo usermod -aG dialout $USER, then log in again"
    if code in (errno.EAGAIN, errno.EBUSY):
        return f"{port}: busy: another program holds the port; close it (lsof {port} names it)"
    return f"{port}: cannot be opened as a serial port ({error})"
