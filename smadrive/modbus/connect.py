"""From a connection URL to an open transport: the one place that knows which transports there are.

serial:///dev/ttyUSB0?baudrate=115200&parity=N&stopbits=1
tcp://host:502                  Modbus TCP; without a port, 502
rtu+tcp://host:port             RTU frames through a gateway; ?baudrate= is that of the line behind it
"""

from __future__ import annotations

from dataclasses import replace
from urllib.parse import SplitResult, parse_qsl, urlsplit

from smadrive.errors import ConfigError
from smadrive.modbus.framing import RtuFraming, TcpFraming
from smadrive.modbus.serialport import SerialTransport
from smadrive.modbus.socketport import SocketTransport
from smadrive.modbus.transport import Parity, SerialSettings, Transport

MODBUS_TCP_PORT = 502

_PARITIES: dict[str, Parity] = {"N": "N", "E": "E", "O": "O"}
_ALLOWED = {
    "baudrate": "baudrate=<bits per second>",
    "parity": "parity=N|E|O",
    "stopbits": "stopbits=1|2",
}


def open_transport(url: str, defaults: SerialSettings | None = None, *, exclusive: bool = True) -> Transport:
    """The connection of a URL.

    `defaults` (a profile's) hold for what the URL leaves open. `exclusive`: a serial port is for this process alone,
    and refused when another has it so. ConfigError: the URL makes no sense;
    TransportError: the port is missing, busy or forbidden, the host unknown, silent or refusing.
    """
    parts = urlsplit(url)
    line = defaults or SerialSettings()
    match parts.scheme:
        case "serial":
            settings = _settings(url, parts.query, line, tuple(_ALLOWED))
            return SerialTransport(_port_path(url, parts), settings, exclusive=exclusive)
        case "tcp":
            host, port = _address(url, parts, MODBUS_TCP_PORT)
            _settings(url, parts.query, line, allowed=())
            return SocketTransport(host, port, TcpFraming(), baudrate=None)
        case "rtu+tcp":
            host, port = _address(url, parts, None)
            settings = _settings(url, parts.query, line, allowed=("baudrate",))
            return SocketTransport(host, port, RtuFraming(), settings.baudrate)
    raise ConfigError(
        f"connection '{url}': unknown scheme '{parts.scheme}'; write serial:///dev/ttyUSB0, tcp://host:502 or "
        "rtu+tcp://host:port"
    )


def _port_path(url: str, parts: SplitResult) -> str:
    if parts.netloc or not parts.path.strip("/"):
        raise ConfigError(f"connection '{url}': names no port; write three slashes, as in serial:///dev/ttyUSB0")
    return parts.path


def _address(url: str, parts: SplitResult, default_port: int | None) -> tuple[str, int]:
    try:
        host, port = parts.hostname, parts.port or default_port
    except ValueError:  # a port that is no number, or too great
        host, port = None, None
    if not host or port is None or parts.path.strip("/"):
        raise ConfigError(f"connection '{url}': names no host and port; write {parts.scheme}://192.168.1.10:502")
    return host, port


def _settings(url: str, query: str, defaults: SerialSettings, allowed: tuple[str, ...]) -> SerialSettings:
    settings = defaults
    for key, text in parse_qsl(query, keep_blank_values=True):
        if key == "baudrate" in allowed and text.isdecimal() and int(text) > 0:
            settings = replace(settings, baudrate=int(text))
        elif key == "parity" in allowed and text in _PARITIES:
            settings = replace(settings, parity=_PARITIES[text])
        elif key == "stopbits" in allowed and text in ("1", "2"):
            settings = replace(settings, stopbits=1 if text == "1" else 2)
        else:
            cure = "allowed are " + ", ".join(_ALLOWED[name] for name in allowed) if allowed else "nothing is allowed"
            raise ConfigError(f"connection '{url}': cannot use '{key}={text}'; {cure}")
    return settings
