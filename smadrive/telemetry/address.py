"""The address of a broker, as the option `--publish` takes it.

    mqtt://USER@HOST:PORT/PREFIX            port 1883
    mqtts://HOST/PREFIX?ca_file=FILE        TLS, port 8883

A password never stands in the address, because other users of the machine can read a command line. It comes from the
environment variable `PASSWORD_VARIABLE`, or from the file that the key `password_file` names.
"""

from __future__ import annotations

import os
import ssl
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn
from urllib.parse import SplitResult, parse_qsl, unquote, urlsplit

from smadrive.errors import ConfigError
from smadrive.files.spelling import suggestion_or_list

WHERE = "--publish"
PASSWORD_VARIABLE = "SMADRIVE_MQTT_PASSWORD"  # noqa: S105 (a name, not a password)
PORTS = {"mqtt": 1883, "mqtts": 8883}
TLS_FILES = ("ca_file", "cert_file", "key_file")
PASSWORD_FILE = "password_file"  # noqa: S105
DEFAULT_PREFIX = "smadrive"
EXAMPLE = "mqtt://broker.example:1883"


@dataclass(frozen=True)
class BrokerAddress:
    """The parsed address of a broker.

    `prefix` is the beginning of all topics. `ca_file`, `cert_file` and `key_file` are PEM files for TLS; without
    `ca_file` the certificates of the system are used. `str` and `repr` show neither user nor password.
    """

    host: str
    port: int
    tls: bool
    user: str | None
    password: str | None
    prefix: str
    ca_file: str | None = None
    cert_file: str | None = None
    key_file: str | None = None

    def __repr__(self) -> str:
        return f"BrokerAddress({self})"

    def __str__(self) -> str:
        """Return the address without user and password."""
        return f"{'mqtts' if self.tls else 'mqtt'}://{self.host}:{self.port}/{self.prefix}"


def parse_address(url: str, environment: Mapping[str, str] = os.environ) -> BrokerAddress:
    """Return the address in `url`. ConfigError when it cannot be used, or when a file that it names cannot be used."""
    parts = _split(url)
    keys = _keys(parts)
    for key, path in keys.items():
        if not os.path.isfile(path):
            raise ConfigError("the file does not exist", where=f"{WHERE}: {key}", value=path, cure="correct the path")
    if parts.scheme == "mqtt" and (found := [key for key in TLS_FILES if key in keys]):
        raise ConfigError("needs TLS", where=f"{WHERE}: {found[0]}", cure="begin the address with mqtts://")
    if ("cert_file" in keys) != ("key_file" in keys):
        raise ConfigError("only one of the two is given", where=f"{WHERE}: cert_file and key_file", cure="give both")
    user = None if parts.username is None else unquote(parts.username)
    if user is None and PASSWORD_FILE in keys:
        cure = "write the user before the host, such as mqtt://USER@HOST"
        raise ConfigError("a password needs a user", where=f"{WHERE}: {PASSWORD_FILE}", cure=cure)
    address = BrokerAddress(
        host=parts.hostname or "",
        port=parts.port or PORTS[parts.scheme],
        tls=parts.scheme == "mqtts",
        user=user,
        password=None if user is None else _password(keys.get(PASSWORD_FILE), environment),
        prefix=_prefix(parts.path),
        **{key: keys.get(key) for key in TLS_FILES},
    )
    if address.tls:
        tls_context(address)
    return address


def tls_context(address: BrokerAddress) -> ssl.SSLContext:
    """Return the context that checks the broker's certificate. ConfigError when one of the PEM files cannot be used."""
    try:
        context = ssl.create_default_context(cafile=address.ca_file)
        if address.cert_file is not None:
            context.load_cert_chain(address.cert_file, address.key_file, lambda: _refuse_pass_phrase(address.key_file))
    except (ssl.SSLError, OSError) as error:
        where, cure = f"{WHERE}: {' and '.join(TLS_FILES)}", "give PEM files; the key must belong to the certificate"
        raise ConfigError("a file cannot be used for TLS", where=where, value=str(error), cure=cure) from None
    return context


def _refuse_pass_phrase(key_file: str | None) -> NoReturn:
    """Raise ConfigError. Without this function, OpenSSL asks for the pass phrase on the terminal, and waits for it."""
    cure = "give a key without a pass phrase, in a file that only this user can read"
    raise ConfigError("the key has a pass phrase", where=f"{WHERE}: key_file", value=key_file, cure=cure)


def _split(url: str) -> SplitResult:
    """Return the parts of the address. ConfigError for a wrong scheme, host or port, a password, or the character #."""
    try:
        parts = urlsplit(url)
        has_port = parts.port != 0
        (parts.hostname or "").encode("idna")  # the form in which a name is looked up; an IP address stays
        url.encode()
    except ValueError:  # UnicodeError is a ValueError, too
        raise _unusable("its port, its host or a character is not valid", url) from None
    if parts.password is not None:
        cure = f"remove it, and set the environment variable {PASSWORD_VARIABLE}, or add ?{PASSWORD_FILE}=FILE"
        raise ConfigError("an address must not hold a password", where=WHERE, cure=cure)
    if parts.fragment or url.endswith("#"):
        raise _unusable("holds the character #", url)
    if parts.scheme not in PORTS:
        raise _unusable("is not the address of an MQTT broker", url)
    if not parts.hostname or not has_port:
        raise _unusable("names no host, or the port 0", url)
    return parts


def _unusable(what: str, url: str) -> ConfigError:
    shown = url.rpartition("@")[2][:60]  # what stands before an @ may be a password
    return ConfigError(what, where=WHERE, value=shown, cure=f"write an address such as {EXAMPLE}")


def _keys(parts: SplitResult) -> dict[str, str]:
    known_keys = (*TLS_FILES, PASSWORD_FILE)
    keys: dict[str, str] = {}
    for key, value in parse_qsl(parts.query.replace("+", "%2B"), keep_blank_values=True):  # a + is no space here
        if key not in known_keys:
            cure = suggestion_or_list(key, known_keys)
            raise ConfigError("unknown key", where=WHERE, value=key, cure=cure)
        if key in keys:
            raise ConfigError("given twice", where=WHERE, value=key, cure="remove one of the two")
        keys[key] = value
    return keys


def _prefix(path: str) -> str:
    prefix = unquote(path).strip("/") or DEFAULT_PREFIX
    if any(character in prefix for character in "+#\0"):
        cure = "choose a prefix without + and #"
        raise ConfigError("a topic must not have wildcards", where=f"{WHERE}: prefix", value=prefix, cure=cure)
    return prefix


def _password(file: str | None, environment: Mapping[str, str]) -> str | None:
    """Return the password in `file`, else that of the environment variable, else None. ConfigError for the file."""
    if file is None:
        return environment.get(PASSWORD_VARIABLE)
    try:
        return Path(file).read_text(encoding="utf-8").rstrip("\r\n")
    except (OSError, UnicodeDecodeError):
        where, cure = f"{WHERE}: {PASSWORD_FILE}", "make the file readable for this user"
        raise ConfigError("the file cannot be read", where=where, value=file, cure=cure) from None
