"""The address at which a program asks the driver of a line to stop, and the check that this program may ask.

The address is a Unix socket in Linux's abstract namespace. It follows from the name of the line. A serial port has one
more address for each of its permanent names. An address exists as long as its driver listens. It is the same for every
user of the machine, and no permission of a folder can hide it. Other systems have no such namespace: on them, a driver
cannot be asked to stop.

A connection to the address is the request. The driver closes the connection when it has released the line. If the
driver refuses the request, it answers REFUSED and closes the connection. The kernel closes the connection of a killed
driver.
"""

from __future__ import annotations

import os
import socket
import struct
import sys
from array import array
from contextlib import suppress
from hashlib import sha256
from pathlib import Path
from typing import NamedTuple
from urllib.parse import urlsplit

from smadrive.devices.state.key import DeviceKey
from smadrive.modbus.transports.pseudo_terminal import TERMINALS
from smadrive.posix import grp, pwd

IS_POSSIBLE = sys.platform == "linux"
"""True on Linux, the only system that has such addresses."""

REFUSED = b"refused"

MOST_NAMES = 16
"""Number of names for the line of a pseudo-terminal: drivers of ended pseudo-terminals may still use some of them."""

MOST_GROUPS = 256
"""Largest number of groups that fit into the 1024 bytes which `getsockopt` of Python can return."""

_SO_PEERGROUPS = 59
"""Socket option SO_PEERGROUPS of Linux, which Python does not name: the supplementary groups of the other end."""

SOCKETS = Path("/proc/net/unix")
"""The kernel's table of Unix sockets: one row for each socket, with its inode and its address."""

_INODE = 6
"""The column of `SOCKETS` that holds the inode."""

_CREDENTIALS = struct.Struct("3i")
_ACL = "system.posix_acl_access"


class PeerProcess(NamedTuple):
    """The process at the other end of a connection, with its user and its groups, as the kernel reports them."""

    pid: int
    user_id: int
    group_ids: tuple[int, ...]

    def may_stop(self, line: str) -> bool:
        """Return True if this peer may stop the calling process, which is the driver of `line`.

        It may do so if it runs as the driver's user or as root, or if its user may read and write the port. Every user
        may do so for a network port, for a port with an access list, and for a port that does not exist.
        """
        path = port_path(line)
        if path is None or self.user_id in (0, os.geteuid()):
            return True
        try:
            port = path.stat()
            if _ACL in os.listxattr(path):  # the access list may allow users whom the permissions do not show
                return True
        except OSError:  # without the port there are no permissions to check
            return True
        if self.user_id == port.st_uid:
            return port.st_mode & 0o600 == 0o600
        if port.st_gid in self.group_ids:
            return port.st_mode & 0o060 == 0o060
        return port.st_mode & 0o006 == 0o006


def address_of(name: str) -> str:
    """Return the address of the driver of the line that has this name."""
    return f"\0smadrive/{sha256(name.encode()).hexdigest()[:32]}"


def alternative_names(name: str) -> tuple[str, ...]:
    """Return the names under which the driver of the line `name` may listen. A driver uses the first free name.

    After the end of a pseudo-terminal, its number is soon reused, while the old driver may still run. So there are
    several names for the number of a pseudo-terminal. The lock of the line excludes two drivers of one pseudo-terminal.
    """
    if TERMINALS not in name:
        return (name,)
    return (name, *(f"{name} place {number}" for number in range(2, MOST_NAMES + 1)))


def names_of_line(line: str, key: DeviceKey) -> tuple[str, ...]:
    """Return the names at which the driver of a line listens: the line, and the permanent names of a serial port.

    So a driver that was started with a link is found by this link, even if the link leads to another port now.
    """
    return (line,) if port_path(line) is None else (line, *sorted(key.names))


def peer_of(connection: socket.socket) -> PeerProcess:
    """Return the process at the other end of the connection. For a driver, this is the process that called listen()."""
    pid, user_id, group_id = _CREDENTIALS.unpack(
        connection.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, _CREDENTIALS.size)
    )
    return PeerProcess(pid, user_id, (group_id, *_supplementary_groups(connection)))


def _supplementary_groups(connection: socket.socket) -> tuple[int, ...]:
    """Return the supplementary groups of the process at the other end; none if there are more than `MOST_GROUPS`."""
    with suppress(OSError):
        return tuple(array("I", connection.getsockopt(socket.SOL_SOCKET, _SO_PEERGROUPS, 4 * MOST_GROUPS)))
    return ()


def listens(pid: int, address: str) -> bool:
    """Return True if the process `pid` still listens at `address`, or if this user may not see its sockets.

    `pid` is the process that called listen(), as the kernel reports it. This process may have ended while a child keeps
    the socket. Then `pid` may be the id of another process by now.
    """
    shown = address.replace("\0", "@")
    try:
        rows = (row.split() for row in SOCKETS.read_text().splitlines())
        sockets = {f"socket:[{row[_INODE]}]" for row in rows if row[-1] == shown}
        return any(str(one.readlink()) in sockets for one in Path(f"/proc/{pid}/fd").iterdir())
    except PermissionError:
        return True
    except OSError:
        return False


def port_path(line: str) -> Path | None:
    """Return the path of the serial port of a line, or None for a network port."""
    parts = urlsplit(line)
    return Path(parts.path) if parts.scheme == "serial" else None


def who_may_open(line: str) -> str:
    """Return the users who may open the port of a line as text, for example `user ann or a member of group dialout`."""
    path = port_path(line)
    try:
        port = None if path is None else path.stat()
    except OSError:
        port = None
    if port is None:
        return "root"
    users = [f"user {_user_name(port.st_uid)}"] if port.st_mode & 0o600 == 0o600 else []
    if port.st_mode & 0o060 == 0o060:
        users.append(f"a member of group {_group_name(port.st_gid)}")
    return " or ".join(users) or "root"


def _user_name(user_id: int) -> str:
    with suppress(KeyError):
        return pwd.getpwuid(user_id).pw_name
    return str(user_id)


def _group_name(group_id: int) -> str:
    with suppress(KeyError):
        return grp.getgrgid(group_id).gr_name
    return str(group_id)
