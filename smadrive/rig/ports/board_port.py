"""Opens the port of an `sma-reference` board that belongs to no rig."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from smadrive.devices.profile.profile import Profile, load_profile
from smadrive.devices.state.lock import Role, lock_line
from smadrive.modbus.transports.connect import open_transport, port_of
from smadrive.modbus.transports.transport import Transport
from smadrive.rig.ports.discovery import port_url

PROFILE = "sma-reference:map_version=2"

BOOT_MS = 5000.0
"""Longest time in ms until a board answers. Many boards restart when their port is opened."""


@contextmanager
def open_board(port: str) -> Iterator[tuple[Transport, Profile]]:
    """Lock and open `port` (see `port_url`) during the `with` block. Return its transport and the profile of the board.

    The profile allows `BOOT_MS` until the first reply. BusyError when the port is in use.
    """
    url, shipped = port_url(port), load_profile(PROFILE)
    profile = shipped.model_copy(update={"timing": shipped.timing.model_copy(update={"boot_ms": BOOT_MS})})
    with lock_line(port_of(url), Role.DRIVER), open_transport(url, profile.serial_settings()) as transport:
        yield transport, profile
