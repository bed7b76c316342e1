"""Bytes to a bus and back, whatever carries them.

A transport brings its clock, so that a deadline means the same to the transport that waits and to the master that
set it: real time on a serial port, virtual time in process.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal, Protocol, Self
from urllib.parse import parse_qsl, urlsplit

from smadrive.clock import Clock
from smadrive.errors import ConfigError

Parity = Literal["N", "E", "O"]

_PARITIES: dict[str, Parity] = {"N": "N", "E": "E", "O": "O"}


class Transport(Protocol):
    """What a master needs of a connection. Every method raises TransportError when the connection is lost."""

    @property
    def clock(self) -> Clock:
        """The clock of its deadlines."""
        ...

    @property
    def name(self) -> str:
        """What error messages call it."""
        ...

    @property
    def baudrate(self) -> int:
        """Bits per second, from which a master derives the standard's pauses."""
        ...

    def write(self, data: bytes) -> None:
        """Send all of `data`."""
        ...

    def read(self, deadline_s: float) -> bytes:
        """Whatever has arrived, at least one byte; empty when nothing came before `deadline_s` of the clock."""
        ...

    def discard(self) -> int:
        """Throw away what has arrived, without waiting; the number of bytes."""
        ...

    def close(self) -> None:
        """Release the connection; closing twice does no harm."""
        ...

    def __enter__(self) -> Self: ...

    def __exit__(self, *exception: object) -> None: ...


@dataclass(frozen=True, slots=True)
class SerialSettings:
    """How a serial line is set; RTU always has 8 data bits."""

    baudrate: int = 115200
    parity: Parity = "N"
    stopbits: Literal[1, 2] = 1


def open_transport(url: str, defaults: SerialSettings | None = None) -> Transport:
    """The connection of `serial:///dev/ttyUSB0?baudrate=115200&parity=N&stopbits=1`.

    `defaults` (a profile's) hold for what the URL leaves open. ConfigError: the URL makes no sense;
    TransportError: the port is missing, busy or forbidden.
    """
    from smadrive.modbus.serialport import SerialTransport  # noqa: PLC0415  (it implements this file's interface)

    parts = urlsplit(url)
    if parts.scheme != "serial":
        raise ConfigError(f"connection '{url}': unknown scheme '{parts.scheme}'; write serial:///dev/ttyUSB0")
    if parts.netloc or not parts.path.strip("/"):
        raise ConfigError(f"connection '{url}': names no port; write three slashes, as in serial:///dev/ttyUSB0")
    return SerialTransport(parts.path, _settings(url, parts.query, defaults or SerialSettings()))


def _settings(url: str, query: str, defaults: SerialSettings) -> SerialSettings:
    settings = defaults
    for key, text in parse_qsl(query, keep_blank_values=True):
        if key == "baudrate" and text.isdecimal() and int(text) > 0:
            settings = replace(settings, baudrate=int(text))
        elif key == "parity" and text in _PARITIES:
            settings = replace(settings, parity=_PARITIES[text])
        elif key == "stopbits" and text in ("1", "2"):
            settings = replace(settings, stopbits=1 if text == "1" else 2)
        else:
            allowed = "baudrate=<bits per second>, parity=N|E|O, stopbits=1|2"
            raise ConfigError(f"connection '{url}': cannot use '{key}={text}'; allowed are {allowed}")
    return settings
