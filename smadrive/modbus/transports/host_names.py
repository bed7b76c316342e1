"""The names of a network port, by which ports are compared.

One host can be written in several ways: `localhost`, `127.0.0.1`, `127.1` and `[::ffff:127.0.0.1]` are the same.

A port has the name that the user wrote, and one more name for each address that the look-up of the host returns. Two
ports with a common name are the same port. After a failed look-up the names cannot prove that two ports differ.
"""

from __future__ import annotations

import socket
import threading
from contextlib import suppress
from ipaddress import IPv4Address, IPv6Address, ip_address

LOOK_UP_WITHIN_S = 0.5
"""A look-up that takes longer than this time in seconds counts as failed."""
NETWORK = "tcp://"


def names_of(port: str) -> frozenset[str]:
    """Return the names of a network port: as written, and with each address of its host.

    `port` has the form `tcp://HOST:NUMBER`, which `port_of` returns.
    """
    host, number = _parts(port)
    return frozenset({port, *(f"{NETWORK}{address}:{number}" for address in _addresses(host))})


def may_be_one(names: frozenset[str], others: frozenset[str]) -> bool:
    """Return True if two ports without a common name may be the same: equal port numbers, and a failed look-up."""
    numbers, other_numbers = _numbers(names), _numbers(others)
    return bool(numbers & other_numbers) and not (_is_looked_up(names) and _is_looked_up(others))


def _addresses(host: str) -> set[str]:
    """Return the addresses of a host in canonical form; return an empty set if the look-up fails or takes too long."""
    found: set[str] = set()

    def look_up() -> None:
        with suppress(OSError, UnicodeError):
            answers = socket.getaddrinfo(host, None, type=socket.SOCK_STREAM)
            found.update({_canonical(str(answer[4][0])) for answer in answers})

    thread = threading.Thread(target=look_up, daemon=True)  # a look-up cannot be interrupted, so it has its own thread
    thread.start()
    thread.join(LOOK_UP_WITHIN_S)
    return set() if thread.is_alive() else found


def _canonical(text: str) -> str:
    """Return the canonical form of an address.

    An unspecified address (0.0.0.0 or ::) becomes the loopback address, because the kernel connects it there.
    """
    address = ip_address(text)
    if isinstance(address, IPv6Address) and address.ipv4_mapped is not None:
        address = address.ipv4_mapped
    if address.is_unspecified:
        address = IPv4Address("127.0.0.1") if address.version == 4 else IPv6Address("::1")
    return str(address)


def _parts(port: str) -> tuple[str, str]:
    host, _, number = port.removeprefix(NETWORK).rpartition(":")
    return host, number


def _numbers(names: frozenset[str]) -> set[str]:
    """Return the network port numbers in the names; an empty set for a serial port."""
    return {_parts(name)[1] for name in names if name.startswith(NETWORK)}


def _is_looked_up(names: frozenset[str]) -> bool:
    """Return True if one of the names has an address as its host: the look-up succeeded, or was not necessary."""
    return any(_is_address(_parts(name)[0]) for name in names)


def _is_address(host: str) -> bool:
    try:
        ip_address(host)
    except ValueError:
        return False
    return True
