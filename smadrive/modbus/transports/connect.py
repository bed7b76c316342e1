"""From a connection URL to an open transport: the one place that knows which transports there are.

serial:///dev/ttyUSB0?baudrate=115200&parity=N&stopbits=1
tcp://host:502                  Modbus TCP; without a port, 502
rtu+tcp://host:port             RTU frames through a gateway; ?baudrate= is that of the line behind it

&latency_ms=200 at any of them: the longest delay of a reply by the connection, on top of the time of the device.
"""

from __future__ import annotations

import errno
import os
from dataclasses import replace
from urllib.parse import SplitResult, parse_qsl, urlsplit

from smadrive.errors import ConfigError
from smadrive.files.number_text import shortened
from smadrive.modbus.framing.framing import RtuFraming, TcpFraming
from smadrive.modbus.transports.descriptor import DescriptorTransport
from smadrive.modbus.transports.serial_port import SerialTransport
from smadrive.modbus.transports.tcp_socket import SocketTransport
from smadrive.modbus.transports.transport import Parity, PortAccess, SerialSettings, Transport

MODBUS_TCP_PORT = 502
MOST_CHARACTERS = 1000
"""Longest URL that is read: longer than any path or name."""

_FORMS = "serial:///dev/ttyUSB0, tcp://host:502 or rtu+tcp://host:port"
_PARITIES: dict[str, Parity] = {"N": "N", "E": "E", "O": "O"}
_ALLOWED = {
    "baudrate": "baudrate=<50 to 12000000>",
    "parity": "parity=N|E|O",
    "stopbits": "stopbits=1|2",
    "latency_ms": "latency_ms=<0 to 5000>",
}
BAUDRATES = (50, 12_000_000)
"""Lowest rate that Linux knows, and highest rate of an adapter on sale."""

_NO_PATH = (errno.ELOOP, errno.ENAMETOOLONG)
"""Errors of a path that can never be a port; a missing or a forbidden port may be there later."""

MOST_LATENCY_MS = 5000
"""Longest latency that can be set: outstanding replies are forgotten after 10 s."""


def open_transport(
    url: str, defaults: SerialSettings | None = None, *, exclusive: bool = True, port_access: PortAccess | None = None
) -> Transport:
    """The connection of a URL, open.

    `defaults` (of a profile) apply where the URL sets nothing. `exclusive`: a serial port is for this process alone,
    and refused when another process has it so. `port_access` is called at every use of the connection.
    ConfigError: the URL cannot be used; TransportError: the port is missing, busy or forbidden, or the host is unknown,
    silent or refuses.
    """
    transport = _opened(url, defaults or SerialSettings(), exclusive=exclusive)
    transport.port_access = port_access
    return transport


def port_of(url: str) -> str:
    """The port that a URL leads to now, in one spelling: without query, links resolved, host in lower case without a
    final dot. A network port has further names (see host_names.py).

    ConfigError when the URL names no port.
    """
    parts = _split(url)
    if parts.scheme == "serial":
        return f"serial://{os.path.realpath(_port_path(url, parts))}"
    host, number = _address(url, parts, MODBUS_TCP_PORT if parts.scheme == "tcp" else None)
    return f"tcp://{host.removesuffix('.')}:{number}"


def latency_s_of(url: str) -> float:
    """The `latency_ms` of a URL, in seconds. ConfigError when the URL has options that no connection knows."""
    return _options(url, _split(url).query, SerialSettings(), tuple(_ALLOWED))[1]


def is_remote(url: str) -> bool:
    """Whether the URL leads over a network, where a device may accept one client only; a local port can open twice."""
    return _split(url).scheme in ("tcp", "rtu+tcp")


def _opened(url: str, line: SerialSettings, *, exclusive: bool) -> DescriptorTransport:
    parts = _split(url)
    match parts.scheme:
        case "serial":
            settings, latency_s = _options(url, parts.query, line, tuple(_ALLOWED))
            return SerialTransport(_port_path(url, parts), settings, exclusive=exclusive, latency_s=latency_s)
        case "tcp":
            host, port = _address(url, parts, MODBUS_TCP_PORT)
            _, latency_s = _options(url, parts.query, line, allowed=("latency_ms",))
            return SocketTransport(host, port, TcpFraming(), None, latency_s)
        case "rtu+tcp":
            host, port = _address(url, parts, None)
            settings, latency_s = _options(url, parts.query, line, allowed=("baudrate", "latency_ms"))
            return SocketTransport(host, port, RtuFraming(), settings.baudrate, latency_s)
    raise ConfigError("unknown scheme", where=_named(url), value=shortened(parts.scheme), cure=f"write {_FORMS}")


def _split(url: str) -> SplitResult:
    """The parts of a URL. ConfigError: a control character, too many characters, or brackets without an address."""
    wrong = "" if url.isprintable() else "it has a control character"
    if len(url) > MOST_CHARACTERS:
        wrong = f"it has {len(url)} characters, limit {MOST_CHARACTERS}"
    try:
        parts = urlsplit(url)
    except ValueError as error:
        wrong = wrong or str(error)
    if wrong:
        raise ConfigError("cannot be read", where=_named(url), value=wrong, cure=f"write {_FORMS}")
    return parts


def _port_path(url: str, parts: SplitResult) -> str:
    if parts.netloc or not parts.path.strip("/"):
        raise ConfigError("names no port", where=_named(url), cure="write three slashes, as in serial:///dev/ttyUSB0")
    try:
        os.stat(parts.path)  # noqa: PTH116  (called for its errors)
    except OSError as error:
        if error.errno in _NO_PATH:
            raise ConfigError(
                "cannot be a path",
                where=_named(url),
                value=error.strerror,
                cure="write a path, as in serial:///dev/ttyUSB0",
            ) from None
    return parts.path


def _address(url: str, parts: SplitResult, default_port: int | None) -> tuple[str, int]:
    try:
        host, port = parts.hostname, parts.port or default_port
        (host or "").encode("idna")  # as the look-up of names does
    except ValueError:  # a port that is not a number or too large; a name with an empty or too long part
        host, port = None, None
    if not host or port is None or parts.path.strip("/"):
        raise ConfigError("names no host and port", where=_named(url), cure=f"write {parts.scheme}://192.168.1.10:502")
    return host, port


def _options(url: str, query: str, defaults: SerialSettings, allowed: tuple[str, ...]) -> tuple[SerialSettings, float]:
    settings, latency_s = defaults, 0.0
    for key, text in parse_qsl(query, keep_blank_values=True):
        if key == "baudrate" in allowed and _is_whole(text, *BAUDRATES):
            settings = replace(settings, baudrate=int(text))
        elif key == "parity" in allowed and text in _PARITIES:
            settings = replace(settings, parity=_PARITIES[text])
        elif key == "stopbits" in allowed and text in ("1", "2"):
            settings = replace(settings, stopbits=1 if text == "1" else 2)
        elif key == "latency_ms" and key in allowed and _is_whole(text, 0, MOST_LATENCY_MS):
            latency_s = int(text) / 1e3
        else:
            cure = "allowed are " + ", ".join(_ALLOWED[name] for name in allowed)
            raise ConfigError("cannot be used", where=_named(url), value=shortened(f"{key}={text}"), cure=cure)
    return settings, latency_s


def _named(url: str) -> str:
    return f"connection {shortened(url, 200)}"


def _is_whole(text: str, least: int, most: int) -> bool:
    return text.isascii() and text.isdecimal() and len(text) <= len(str(most)) and least <= int(text) <= most
