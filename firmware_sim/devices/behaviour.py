"""What every simulated firmware can, whatever device it makes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple, Protocol

from firmware_sim.devices.registers import Quantity


class Behaviour(Protocol):
    """The program of a device: it sees its sensors and decides the current."""

    @property
    def current_a(self) -> float:
        """What the device wants to drive through the wire."""
        ...

    @property
    def voltage_max_v(self) -> float:
        """The voltage beyond which its output does not go."""
        ...

    def restart(self) -> None:
        """A power-up."""
        ...

    def tick(self, dt_s: float) -> None:
        """Let `dt_s` pass."""
        ...


class RegisterBehaviour(Behaviour, Protocol):
    """One that is told writes and shows quantities by role, and knows nothing of registers."""

    def check(self, values: Mapping[str, float]) -> None:
        """ModbusException when a write of these roles cannot be carried out."""
        ...

    def write(self, values: Mapping[str, float]) -> None:
        """Carry out a write of these roles, all of one request together."""
        ...

    def quantities(self) -> Mapping[str, Quantity]:
        """What the registers show, by role."""
        ...


class Answers(Protocol):
    """The server side of a device's bus."""

    def answer(self, pdu: bytes) -> bytes:
        """Carry out what a request says; what its reply says."""
        ...


class Inside(NamedTuple):
    """What makes a device go, and who answers for it."""

    firmware: Behaviour
    responder: Answers
