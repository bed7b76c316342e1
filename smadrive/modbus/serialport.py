"""A serial port as a transport.

pyserial opens and sets the port. Bytes then move by plain system calls on its descriptor: pyserial's own read takes
its timeout from an attribute whose change reprograms the port, which is no way to meet an absolute deadline.
"""

from __future__ import annotations

import errno
import os
import select
from contextlib import suppress
from typing import NoReturn, Self

import serial
from serial.tools import list_ports

from smadrive.clock import MonotonicClock
from smadrive.errors import TransportError
from smadrive.modbus.framing import RtuFraming
from smadrive.modbus.transport import SerialSettings

_CHUNK = 512


class SerialTransport:
    """An open serial port, for this process alone (a second smadrive is refused)."""

    def __init__(self, port: str, settings: SerialSettings) -> None:
        """Open `port`; TransportError tells whether it is missing, busy or forbidden, and the cure."""
        self.clock = MonotonicClock()
        self.name = port
        self.baudrate = settings.baudrate
        self.framing = RtuFraming()
        try:
            self._port = serial.Serial(
                port,
                baudrate=settings.baudrate,
                parity=settings.parity,
                stopbits=settings.stopbits,
                timeout=0,
                exclusive=True,
            )
        except (serial.SerialException, OSError, ValueError) as error:
            raise TransportError(_cure(port, error)) from None
        self._descriptor = self._port.fileno()
        with suppress(ValueError, OSError, AttributeError):  # USB adapters then deliver after 1 ms, not after 16
            self._port.set_low_latency_mode(True)

    def write(self, data: bytes) -> None:
        """Send all of `data`; TransportError when the port is gone or takes no more."""
        try:
            sent = os.write(self._descriptor, data)
        except OSError as error:
            self._lost(error)
        if sent < len(data):
            raise TransportError(f"{self.name}: the port took {sent} of {len(data)} bytes: is the adapter stuck?")

    def read(self, deadline_s: float) -> bytes:
        """Whatever has arrived, at least one byte; empty when nothing came before `deadline_s`."""
        try:
            remaining_s = max(deadline_s - self.clock.now_s(), 0.0)
            ready, _, _ = select.select((self._descriptor,), (), (), remaining_s)
            if not ready:
                return b""
            data = os.read(self._descriptor, _CHUNK)
        except (OSError, ValueError) as error:  # ValueError: select on a closed port
            self._lost(error)
        if not data:
            self._lost(OSError("the port is readable and has no data"))
        return data

    def discard(self) -> int:
        """Throw away what has arrived; the number of bytes."""
        discarded = 0
        try:
            while data := os.read(self._descriptor, _CHUNK):
                discarded += len(data)
        except BlockingIOError:
            pass  # an empty port says so in either of two ways
        except OSError as error:
            self._lost(error)
        return discarded

    def close(self) -> None:
        """Close the port; closing twice does no harm."""
        self._port.close()
        self._descriptor = -1

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()

    def _lost(self, error: Exception) -> NoReturn:
        raise TransportError(
            f"{self.name}: the connection is lost ({error}): is the adapter plugged in and the device powered?"
        ) from None


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
