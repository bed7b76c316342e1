"""The processes beside the loop, as the control process sees them: the page, and the workshop."""

from __future__ import annotations

from pathlib import Path

from smadrive.tuning.beside import Beside
from smadrive.tuning.channel import ControlEnd
from smadrive.tuning.parcels import ParcelPair
from smadrive.tuning.workshop import Order, Outcome, Refused, packed_order, unpacked_outcome

NICENESS = 5
"""The page stands back; not the workshop: what it builds, somebody with a hand on a knob waits for."""


class PageProcess(Beside):
    """A context manager: `url` is where the page is while it lasts; it stays there when the process is started anew."""

    def __init__(self, channel: ControlEnd, *, port: int, token: str, rig_file: Path, folder: Path) -> None:
        fds = (channel.memory_fd, channel.page_socket.fileno())
        told = {
            "port": port,
            "token": token,
            "rig_file": str(rig_file),
            "folder": str(folder),
            "memory_fd": fds[0],
            "socket_fd": fds[1],
        }
        cure = "is the port taken? choose another --port"
        super().__init__("smadrive.tuning.server", told, fds, cure, niceness=NICENESS)

    @property
    def url(self) -> str:
        """The address of the page, with the token that allows to control."""
        return f"http://127.0.0.1:{self._told['port']}/?token={self._told['token']}"


class WorkshopProcess(Beside):
    """A Workshop in a process of its own, at the other end of `parcels`."""

    def __init__(self, parcels: ParcelPair) -> None:
        super().__init__(
            "smadrive.tuning.workshop_server", {"fds": parcels.fds}, parcels.fds, "is the installation complete?"
        )
        self._parcels = parcels
        self._order: Order | None = None
        self._number = 0
        self._deaths_before = 0

    def begin(self, order: Order) -> None:
        """See Workshop."""
        self._number += 1
        self._order, self._deaths_before = order, self.deaths
        self._parcels.send(self._number, packed_order(order))

    def outcome(self) -> Outcome | None:
        """See Workshop; an order that died with its process is refused."""
        if self._order is None:
            return None
        outcome: Outcome | None = None
        parcel = self._parcels.received()
        if parcel is not None and parcel.number == self._number:
            outcome = unpacked_outcome(parcel.content, self._order)
        elif self.deaths != self._deaths_before:
            outcome = Refused("the workshop process ended over it, and is started anew: try again")
        if outcome is not None:
            self._order = None
        return outcome
