"""A transport over a serial port. pyserial opens the port and sets its baud rate, parity and stop bits."""

from __future__ import annotations

import errno
import os
from contextlib import suppress
from pathlib import Path

import serial
from serial.tools import list_ports

from smadrive.errors import TransportError, free_the_line
from smadrive.modbus.framing.framing import RtuFraming
from smadrive.modbus.transports.descriptor import DescriptorTransport
from smadrive.modbus.transports.pseudo_terminal import TERMINALS, PseudoTerminal
from smadrive.modbus.transports.transport import SerialSettings
from smadrive.posix import fcntl, grp, termios


class SerialTransport(DescriptorTransport):
    """An open serial port. `exclusive=True` takes the lock of the port, which only one process can have."""

    end = "the port is readable but has no data"
    cure = "check that the adapter is plugged in and the device powered"
    reconnects = False  # opening a port resets many boards
    empty_reads_at_end = 3  # another process that opens the port flushes bytes before they are read here

    def __init__(self, port: str, settings: SerialSettings, *, exclusive: bool = True, latency_s: float = 0.0) -> None:
        """Open `port`; TransportError when it is missing, busy or forbidden."""
        self._settings = settings
        self._exclusive = exclusive
        self._terminal: PseudoTerminal | None = None
        super().__init__(port, RtuFraming(), settings.baudrate, timeout_s=0.0, latency_s=latency_s)

    def disconnect(self) -> None:
        """Release the lock of the port, and close the port.

        Closing alone would not release the lock while a forked child has the port open.
        """
        if not self.lost:
            with suppress(OSError):
                fcntl.flock(self._descriptor, fcntl.LOCK_UN)
        super().disconnect()

    def close_inherited(self) -> None:
        """Close the port for good in a forked child. The lock of the port stays with the parent."""
        super().close_inherited()
        if self._terminal is not None:
            self._terminal.close()

    def _open_port(self, _timeout_s: float) -> int:
        """Open the port, and return its descriptor. This takes no time, so the time limit is not used."""
        if self._terminal is not None and self._terminal.is_left_over:
            raise TransportError(
                "the pseudo-terminal has ended, and its number may belong to another pseudo-terminal now",
                where=self.name,
                cure="start its program again, and give the path of the new pseudo-terminal",
            )
        self._terminal = PseudoTerminal.at(self.name)
        self._port = port = serial.Serial(
            baudrate=self._settings.baudrate,
            parity="N" if _is_pseudo_terminal(self.name) else self._settings.parity,
            stopbits=self._settings.stopbits,
            timeout=0,
            exclusive=True if self._exclusive else None,
        )
        port.port = self.name
        try:
            port.open()
        except (
            serial.SerialException,
            termios.error,
            OSError,
            ValueError,
        ) as error:  # a port that vanishes while it opens
            raise _failure(self.name, error) from None
        with suppress(ValueError, OSError, AttributeError):  # USB adapters then deliver after 1 ms instead of 16 ms
            port.set_low_latency_mode(True)
        descriptor: int = port.fileno()
        return descriptor


def _is_pseudo_terminal(port: str) -> bool:
    """Return True if `port` is a pseudo-terminal.

    A pseudo-terminal has no parity, and Linux rejects a parity that is set a second time.
    """
    return os.path.realpath(port).startswith(TERMINALS)


def _failure(port: str, error: Exception) -> TransportError:
    """Return the error for a port that cannot be opened."""
    code = getattr(error, "errno", None)
    if code == errno.ENOENT:
        present = ", ".join(sorted(found.device for found in list_ports.comports())) or "none"
        return TransportError(
            "no such port",
            where=port,
            value=f"serial ports present: {present}",
            cure="plug the adapter in, or start firmware-sim with `--pty` and this path. A replugged adapter may have "
            "another number: use its name in /dev/serial/by-id, which never changes",
        )
    if code in (errno.EACCES, errno.EPERM):
        return TransportError(
            "not permitted",
            where=port,
            cure=f"join the group of the port: sudo usermod -aG {_group_of(port)} $USER, then log in again",
        )
    if code in (errno.EAGAIN, errno.EBUSY):
        pid = _locked_by(port)
        holder = "another program" if pid is None else f"process {pid}"
        return TransportError(f"busy, because {holder} uses the port", where=port, cure=free_the_line(pid))
    cure = "check the path in the URL"
    if code == errno.EISDIR:
        return TransportError("a folder, not a serial port", where=port, cure=cure)
    return TransportError("cannot be opened as a serial port", where=port, value=error, cure=cure)


def _locked_by(port: str) -> int | None:
    """Return the id of the process that has the lock of `port`; return None when /proc/locks does not list it."""
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
