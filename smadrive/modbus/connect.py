"""From a connection URL to an open transport: the one place that knows which transports there are."""

from __future__ import annotations

from dataclasses import replace
from urllib.parse import parse_qsl, urlsplit

from smadrive.errors import ConfigError
from smadrive.modbus.serialport import SerialTransport
from smadrive.modbus.transport import Parity, SerialSettings, Transport

_PARITIES: dict[str, Parity] = {"N": "N", "E": "E", "O": "O"}


def open_transport(url: str, defaults: SerialSettings | None = None) -> Transport:
    """The connection of `serial:///dev/ttyUSB0?baudrate=115200&parity=N&stopbits=1`.

    `defaults` (a profile's) hold for what the URL leaves open. ConfigError: the URL makes no sense;
    TransportError: the port is missing, busy or forbidden.
    """
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
