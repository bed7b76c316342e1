"""Opens the transport that a connection URL names. Only this file lists the kinds of transport.

serial:///dev/ttyUSB0?baudrate=115200&parity=N&stopbits=1
tcp://host:502                  Modbus TCP; the port is 502 if it is left out
rtu+tcp://host:port             RTU frames through a gateway; ?baudrate= is the rate of the serial line behind it

Each URL may set latency_ms, for example ?latency_ms=200: the longest time in ms by which the connection delays a reply.
It is added to the response timeout of the device.
"""

from __future__ import annotations

import errno
import os
import re
from dataclasses import replace
from urllib.parse import SplitResult, parse_qsl, urlsplit

from smadrive.errors import ConfigError
from smadrive.files.number_text import shortened
from smadrive.files.spelling import suggestion
from smadrive.modbus.framing.framing import RtuFraming, TcpFraming
from smadrive.modbus.transports.descriptor import DescriptorTransport
from smadrive.modbus.transports.serial_port import SerialTransport
from smadrive.modbus.transports.tcp_socket import SocketTransport
from smadrive.modbus.transports.transport import Parity, PortAccess, SerialSettings, Transport

MODBUS_TCP_PORT = 502
MOST_CHARACTERS = 1000
"""Longest URL that is accepted, in characters."""

SCHEMES = ("serial", "tcp", "rtu+tcp")
_FORMS = "serial:///dev/ttyUSB0, tcp://host:502 or rtu+tcp://host:port"
_WINDOWS_PORT = re.compile(r"COM\d+", re.IGNORECASE)
_PARITIES: dict[str, Parity] = {"N": "N", "E": "E", "O": "O"}
_ALLOWED = {
    "baudrate": "baudrate=<50 to 12000000>",
    "parity": "parity=N|E|O",
    "stopbits": "stopbits=1|2",
    "latency_ms": "latency_ms=<0 to 5000>",
}
BAUDRATES = (50, 12_000_000)
"""The lowest baud rate that Linux knows, and the highest of an adapter on the market, in bits per second."""

_NO_PATH = (errno.ELOOP, errno.ENAMETOOLONG)
"""Error numbers of `stat` for a path that can never be a port. ENOENT is not listed: the port may appear later."""

MOST_LATENCY_MS = 5000
"""Longest latency that a URL can set, in ms. It must be shorter than outstanding.py's `LATEST_REPLY_S`."""


def open_transport(
    url: str, defaults: SerialSettings | None = None, *, exclusive: bool = True, port_access: PortAccess | None = None
) -> Transport:
    """Open the connection that a URL names, and return it.

    defaults: serial settings, such as those of a profile, for the options that the URL does not set.
    exclusive: True locks a serial port. This fails when another process has locked the port.
    port_access: called before each use of the open connection; see `PortAccess`.

    Raises ConfigError when the URL cannot be used. Raises TransportError when the port is missing, busy or forbidden,
    or when the host is unknown, silent or refuses the connection.
    """
    transport = _opened(url, defaults or SerialSettings(), exclusive=exclusive)
    transport.port_access = port_access
    return transport


def port_of(url: str) -> str:
    """Return the URL of the port in a canonical form, by which ports can be compared.

    Options are removed, and links in a path are resolved. `rtu+tcp` becomes `tcp`, and the host is in lower case
    without a final dot. host_names.py finds the other names of a network port.

    ConfigError when the URL names no port, or has an unknown scheme.
    """
    parts = _split(url)
    if parts.scheme == "serial":
        return f"serial://{os.path.realpath(_port_path(url, parts))}"
    if parts.scheme not in SCHEMES:
        raise _unknown_scheme(url, parts.scheme)
    host, number = _address(url, parts, MODBUS_TCP_PORT if parts.scheme == "tcp" else None)
    return f"tcp://{host.removesuffix('.')}:{number}"


def line_settings(url: str, defaults: SerialSettings | None) -> SerialSettings | None:
    """Return the settings with which `open_transport` opens a serial port; None for a port on a network.

    ConfigError when an option or value is unknown.
    """
    parts = _split(url)
    if parts.scheme != "serial":
        return None
    return _options(url, parts.query, defaults or SerialSettings(), tuple(_ALLOWED))[0]


def latency_s_of(url: str) -> float:
    """Return `latency_ms` of a URL in seconds; 0 if it is not set. ConfigError when an option or value is unknown."""
    return _options(url, _split(url).query, SerialSettings(), tuple(_ALLOWED))[1]


def is_one_line(url: str) -> bool:
    """Return True if all units at the port share one line: a serial port, here or behind a socket (`rtu+tcp`).

    A serial server sends each reply to all its clients, so two programs would take each other's replies for their own.
    """
    return _split(url).scheme != "tcp"


def is_remote(url: str) -> bool:
    """Return True if the URL leads over a network.

    The number of clients differs: a device on a network may accept only one client, but two processes can open a local
    port.
    """
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
    raise _unknown_scheme(url, parts.scheme)


def _unknown_scheme(url: str, scheme: str) -> ConfigError:
    """Return the error for an unknown scheme. Its cure names the most similar scheme, and the forms of all schemes."""
    if not scheme and (cure := _cure_of_path(url)):
        return ConfigError("not a port", where=_named(url), cure=cure)
    cure = f"{suggestion(scheme, SCHEMES)} Write {_FORMS}, or sim://NAME in a rig file".strip()
    return ConfigError("unknown scheme", where=_named(url), value=shortened(scheme), cure=cure)


def _cure_of_path(url: str) -> str:
    """Return the cure if the text is a path, a port name of Windows or a config file; otherwise return ""."""
    if url.startswith("/"):
        return f"write serial://{url}"
    if _WINDOWS_PORT.fullmatch(url):
        return "smadrive opens ports on Linux and macOS only: write the path there, such as serial:///dev/ttyUSB0"
    if url.endswith(".toml"):
        return f"a config file is given; give the port of the device, such as {_FORMS}"
    return ""


def _split(url: str) -> SplitResult:
    """Return the parts of a URL.

    ConfigError when the URL has a control character, is too long, or has brackets without an address.
    """
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
        cure = "write three slashes and the path, as in serial:///dev/ttyUSB0"
        raise ConfigError("names no port", where=_named(url), cure=cure)
    try:
        os.stat(parts.path)  # noqa: PTH116  (only its errors matter)
    except OSError as error:
        if error.errno in _NO_PATH:
            raise ConfigError(
                "cannot be the path of a port",
                where=_named(url),
                value=error.strerror,
                cure="write the path of the port, as in serial:///dev/ttyUSB0",
            ) from None
    return parts.path


def _address(url: str, parts: SplitResult, default_port: int | None) -> tuple[str, int]:
    try:
        host, port = parts.hostname, parts.port or default_port
        (host or "").encode("idna")  # the look-up of names does the same, and fails for the same names
    except ValueError:  # the port is no number or too large, or a part of the name is empty or too long
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
            raise ConfigError("unknown option or value", where=_named(url), value=shortened(f"{key}={text}"), cure=cure)
    return settings, latency_s


def _named(url: str) -> str:
    return f"connection {shortened(url, 200)}"


def _is_whole(text: str, least: int, most: int) -> bool:
    return text.isascii() and text.isdecimal() and len(text) <= len(str(most)) and least <= int(text) <= most
