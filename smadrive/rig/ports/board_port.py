"""Opens the port of an `sma-reference` board that belongs to no rig."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from smadrive.devices.profile.profile import Profile, load_profile
from smadrive.devices.state.port_lock import lock_port
from smadrive.modbus.transports.connect import open_transport
from smadrive.modbus.transports.transport import Transport
from smadrive.rig.ports.discovery import port_url

PROFILE = "sma-reference:map_version=2"


@contextmanager
def open_board(port: str) -> Iterator[tuple[Transport, Profile]]:
    """Lock and open `port` (see `port_url`) during the `with` block. Return its transport and the profile of the board.

    BusyError when the port is in use.
    """
    url, profile = port_url(port), load_profile(PROFILE)
    with lock_port(url, (profile.unit_id,)), open_transport(url, profile.serial_settings()) as transport:
        yield transport, profile
