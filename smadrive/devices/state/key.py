"""The key of a device. A comparison of two keys decides if a device is the same as in an earlier run.

The kernel numbers ports in the order in which they appear: after a replug, `ttyUSB0` or `pts/7` may name another
device. So a key holds the permanent names of the port and, after the device has answered, its serial number. The names:

    USB adapter              its links in /dev/serial/by-id and by-path, and its place on the USB bus
    link of the user's own   the path of the link (a udev rule, `firmware-sim --pty PATH`, `socat link=PATH`)
    on-board serial port     its path
    network                  host and port, as written and with each address of the host; see host_names.py
    pseudo-terminal          no permanent name, but its number with its time of creation, while it exists. An ended
                             pseudo-terminal never comes back: then only the serial number of the device counts

Devices that share a line have different unit ids. `APPLIES` tells when a trip with one key applies to a device
with another key.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, field, replace
from enum import Enum
from hashlib import sha256
from pathlib import Path
from urllib.parse import urlsplit

from serial.tools import list_ports

from smadrive.devices.identity import Identity
from smadrive.devices.profile.profile import Profile
from smadrive.modbus.transports.connect import is_one_line, port_of
from smadrive.modbus.transports.host_names import may_be_one, names_of
from smadrive.modbus.transports.pseudo_terminal import TERMINALS

BY_ID = Path("/dev/serial/by-id")
BY_PATH = Path("/dev/serial/by-path")
NUMBERED = re.compile(r"tty(USB|ACM)\d+|rfcomm\d+")
"""Names of ports that the kernel numbers in the order in which the ports appear."""
UNPROGRAMMED = (0, 0xFFFF, 0xFFFF_FFFF)
"""Raw numbers in the serial-number register of a device to which no serial number was given."""


class Match(Enum):
    """The result of comparing one part of two keys."""

    SAME = "same"
    DIFFERENT = "different"
    UNKNOWN = "unknown"


APPLIES = {
    # (port, serial number)
    (Match.SAME, Match.SAME): True,
    (Match.SAME, Match.DIFFERENT): False,
    (Match.SAME, Match.UNKNOWN): True,
    (Match.DIFFERENT, Match.SAME): True,
    (Match.DIFFERENT, Match.DIFFERENT): False,
    (Match.DIFFERENT, Match.UNKNOWN): False,
    (Match.UNKNOWN, Match.SAME): True,
    (Match.UNKNOWN, Match.DIFFERENT): False,
    (Match.UNKNOWN, Match.UNKNOWN): True,  # nothing proves that the device is another one
}
"""True if a latched trip applies to the present device, by the match of port and serial number of their keys."""


@dataclass(frozen=True)
class DeviceKey:
    """The key of a device.

    names            permanent names of the port; empty if they are unknown
    unit_id          unit id on the line; None for a device without one
    serial_number    serial number; None if it is unknown
    type_id          id of the profile that the device has proved; None if it is unknown
    port             present name of the port as a URL; it is not compared
    is_one_line      True if all units of the port share one line; it is not compared
    """

    names: frozenset[str]
    unit_id: int | None
    serial_number: str | None = None
    type_id: str | None = field(default=None, kw_only=True)
    port: str = field(default="", compare=False)
    is_one_line: bool = field(default=False, compare=False)

    @property
    def digest(self) -> str:
        """A short text for the names of files that belong to this key."""
        return sha256(repr((sorted(self.names), self.unit_id, self.serial_number)).encode()).hexdigest()[:32]

    def port_match(self, other: DeviceKey) -> Match:
        """Compare the unit ids and the port names of both keys. One common name proves that the port is the same."""
        if None not in (self.unit_id, other.unit_id) and self.unit_id != other.unit_id:
            return Match.DIFFERENT
        if self.names & other.names:
            return Match.SAME
        if not (self.names and other.names) or may_be_one(self.names, other.names):
            return Match.UNKNOWN
        return Match.DIFFERENT

    def serial_match(self, other: DeviceKey) -> Match:
        """Compare the serial numbers of both keys."""
        if self.serial_number is None or other.serial_number is None:
            return Match.UNKNOWN
        return Match.SAME if self.serial_number == other.serial_number else Match.DIFFERENT

    def applies_to(self, other: DeviceKey) -> bool:
        """Return True if a trip of this device applies to `other`; see APPLIES."""
        return APPLIES[self.port_match(other), self.serial_match(other)]

    def proves(self, other: DeviceKey) -> bool:
        """Return True if `other` is certainly this device: then a guardian of this device may end when `other` is off.

        A device with a serial number must show the same serial number, and must not have another type: devices of
        different types may have the same number. Any other device is recognised by its port.
        """
        if self.serial_number is not None or other.serial_number is not None:
            same_type = self.type_id == other.type_id or None in (self.type_id, other.type_id)
            return same_type and self.serial_match(other) is Match.SAME
        return self.port_match(other) is Match.SAME

    def with_identity(self, profile: Profile, identity: Identity) -> DeviceKey:
        """Return this key with serial number and type of the device, which has proved its identity."""
        return replace(self, serial_number=serial_number(profile, identity), type_id=profile.profile.id)


def key_at(url: str, profile: Profile, unit_id: int | None) -> DeviceKey:
    """Return the key of a device that has not answered yet. ConfigError when the URL names no port."""
    return unit_key(url, (profile.unit_id if unit_id is None else unit_id) if profile.has_registers else None)


def unit_key(url: str, unit_id: int | None) -> DeviceKey:
    """Return the key of the unit with this id at the port. ConfigError when the URL names no port."""
    return DeviceKey(port_names(url), unit_id, port=port_of(url), is_one_line=is_one_line(url))


def serial_number(profile: Profile, identity: Identity) -> str | None:
    """Return the serial number as text; None if it is unknown.

    It consists of the values of the `[[identify]]` registers without `ranges`, separated by spaces.
    """
    names = sorted(proof.register_ for proof in profile.identify if not proof.ranges)
    values = [identity[name] for name in names if identity.get(name, UNPROGRAMMED[0]) not in UNPROGRAMMED]
    return " ".join(str(value) for value in values) or None


def port_names(url: str) -> frozenset[str]:
    """Return the names that identify the port (see the head of this file); return an empty set if it has none."""
    port = port_of(url)
    if urlsplit(url).scheme != "serial":
        return names_of(port)
    return frozenset(_serial_names(Path(urlsplit(url).path), Path(urlsplit(port).path)))


def _is_link(path: Path) -> bool:
    """Return True if the path is a link, False if not, or if the user may not enter the folder of the path."""
    try:
        return path.is_symlink()
    except OSError:
        return False


def _serial_names(written: Path, port: Path) -> Iterator[str]:
    """Yield the permanent names of a serial port. `written` is the path in the rig file, `port` its target."""
    if _is_link(written) or written.parent in (BY_ID, BY_PATH):
        yield f"{os.path.realpath(written.parent)}/{written.name}"
    for folder in (BY_ID, BY_PATH):
        yield from (str(link) for link in folder.glob("*") if os.path.realpath(link) == str(port))
    if str(port).startswith(TERMINALS):
        with suppress(OSError):
            yield f"{port} of {port.stat().st_ctime_ns}"
    elif NUMBERED.fullmatch(port.name):
        yield from (f"usb {one.location}" for one in list_ports.comports() if one.device == str(port) and one.location)
    else:
        yield str(port)
