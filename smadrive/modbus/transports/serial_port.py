"""A serial port as a transport: pyserial opens and sets the port."""

from __future__ import annotations

import errno
import fcntl
import grp
import os
import termios
from contextlib import suppress
from pathlib import Path

import serial
from serial.tools import list_ports

from smadrive.errors import TransportError
from smadrive.modbus.framing.framing import RtuFraming
from smadrive.modbus.transports.descriptor import DescriptorTransport
from smadrive.modbus.transports.transport import SerialSettings


class SerialTransport(DescriptorTransport):
    """An open serial port; `exclusive`: for this process alone (a second smadrive is refused)."""

    end = "the port is readable and has no data"
    suspicion = "is the adapter plugged in and the device powered?"
    reconnects = False  # opening a port resets many boards
    empty_reads_at_end = 3  # another process that opens the port flushes what was about to be read

    def __init__(self, port: str, settings: SerialSettings, *, exclusive: bool = True, latency_s: float = 0.0) -> None:
        """Open `port`; TransportError tells whether it is missing, busy or forbidden, and the cure."""
        self._settings = settings
        self._exclusive = exclusive
        super().__init__(port, RtuFraming(), settings.baudrate, timeout_s=0.0, latency_s=latency_s)

    def disconnect(self) -> None:
        """Let the port go, and its lock, which a forked child would keep."""
        if not self.lost:
            with suppress(OSError):
                fcntl.flock(self._descriptor, fcntl.LOCK_UN)
        super().disconnect()

    def _open_port(self, _timeout_s: float) -> serial.Serial:
        """The port; it opens at once or not at all."""
        try:
            port = serial.Serial(
                self.name,
                baudrate=self._settings.baudrate,
                parity="N" if _is_pseudo_terminal(self.name) else self._settings.parity,
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


def _is_pseudo_terminal(port: str) -> bool:
    """Whether no line is behind it, so that it has no parity: Linux refuses one when it is set again."""
    return os.path.realpath(port).startswith("/dev/pts/")


def _cure(port: str, error: Exception) -> str:
    """Why `port` does not open, and what to do about it."""
    code = getattr(error, "errno", None)
    if code == errno.ENOENT:
        present = ", ".join(sorted(found.device for found in list_ports.comports())) or "none"
        return (
            f"{port}: no such port; serial ports present: {present}: is the adapter plugged in, or does firmware-sim "
            "serve there (--pty)? A replugged adapter may come back with another number: its name in /dev/serial/by-id "
            "stays"
        )
    if code in (errno.EACCES, errno.EPERM):
        group = _group_of(port)
        return f"{port}: not permitted; join the group that owns it: sudo usermod -aG {group} $USER, then log in again"
    if code in (errno.EAGAIN, errno.EBUSY):
        pid = _locked_by(port)
        who, kill = ("another program", "`kill` of it") if pid is None else (f"process {pid}", f"`kill {pid}`")
        return (
            f"{port}: busy: {who} holds the port: close it. A smadrive that runs or tunes there switches the heater "
            f"off at Ctrl-C in its terminal, at {kill}, or at OFF (POST /off) of its page"
        )
    return f"{port}: cannot be opened as a serial port ({error})"


def _locked_by(port: str) -> int | None:
    """Which process has the lock of `port`, where Linux tells it."""
    try:
        found = Path(port).stat()
        place = f"{os.major(found.st_dev):02x}:{os.minor(found.st_dev):02x}:{found.st_ino}"
        locks = [line.split() for line in Path("/proc/locks").read_text().splitlines()]
    except OSError:
        return None
    return next((int(lock[4]) for lock in locks if lock[1] == "FLOCK" and lock[5] == place and int(lock[4]) > 0), None)


def _group_of(port: str) -> str:
    try:
        return grp.getgrgid(Path(port).stat().st_gid).gr_name
    except (OSError, KeyError):
        return "dialout"
