"""The register bank of a simulated device: any profile, filled and read by role.

A write is checked whole before any of it takes effect: a request that is refused has changed nothing.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from firmware_sim.refusal import ILLEGAL_ADDRESS, ILLEGAL_VALUE, Refusal
from smadrive.device.profile import Profile
from smadrive.device.registers import Register
from smadrive.errors import ConfigError


class Write(NamedTuple):
    """One register about to be written: its words, and what they mean."""

    name: str
    register: Register
    words: Sequence[int]
    value: float


class RegisterBank:
    """The registers of `profile`, all zero but those that prove its identity."""

    def __init__(self, profile: Profile) -> None:
        self._profile = profile
        self._words: dict[str, dict[int, int]] = {"holding": {}, "input": {}}
        self._at: dict[int, tuple[str, Register]] = {}
        self._roles: dict[str, list[tuple[int, str, Register]]] = {"holding": [], "input": []}
        self._role_of = {name: role for role, name in profile.roles.model_dump(exclude_none=True).items()}
        for name, register in profile.registers.items():
            self._words[register.table] |= dict.fromkeys(register.addresses, 0)
            if register.table == "holding":
                self._at[register.address] = (name, register)
            if name in self._role_of:
                self._roles[register.table].append((register.address, self._role_of[name], register))
        for proof in profile.identify:
            register = profile.register(proof.register_)
            self._store(register, register.pack(proof.ranges[0][0]))

    def publish(self, quantities: Mapping[str, float | None], table: str, first: int, count: int) -> None:
        """Refresh the registers of these roles that lie in a range about to be read."""
        for address, role, register in self._roles[table]:
            if first <= address < first + count and role in quantities:
                value = quantities[role]
                self._store(register, _no_reading(register) if value is None else _saturated(register, value))

    def preset(self, name: str, value: float) -> None:
        """Set a register that no role fills; a profile without it is none the worse."""
        if name in self._profile.registers:
            register = self._profile.register(name)
            self._store(register, _saturated(register, value))

    def read(self, table: str, first: int, count: int) -> list[int]:
        """The words; Refusal when one of them does not exist."""
        words = self._words[table]
        try:
            return [words[address] for address in range(first, first + count)]
        except KeyError:
            raise Refusal(ILLEGAL_ADDRESS) from None

    def check_readable(self, table: str, first: int, count: int) -> None:
        """Refusal when one of the words does not exist."""
        words = self._words[table]
        if any(address not in words for address in range(first, first + count)):
            raise Refusal(ILLEGAL_ADDRESS)

    def checked(self, first: int, words: Sequence[int]) -> list[Write]:
        """The writes of whole registers that `words` make up; Refusal when one of them cannot be carried out."""
        writes = []
        at = 0
        while at < len(words):
            if first + at not in self._at:
                raise Refusal(ILLEGAL_ADDRESS)
            name, register = self._at[first + at]
            part = words[at : at + register.size]
            if not register.writable or len(part) < register.size:
                raise Refusal(ILLEGAL_ADDRESS)
            writes.append(Write(name, register, part, register.decode(part).value))
            at += register.size
        for write in writes:
            try:
                write.register.encode(write.value, write.name)
            except ConfigError:
                raise Refusal(ILLEGAL_VALUE) from None
        return writes

    def by_role(self, writes: Sequence[Write]) -> dict[str, float]:
        """The values of those writes whose register plays a role."""
        return {self._role_of[write.name]: write.value for write in writes if write.name in self._role_of}

    def store(self, writes: Sequence[Write]) -> None:
        """Carry out checked writes; a write-only register keeps nothing."""
        for write in writes:
            if write.register.access == "rw":
                self._store(write.register, write.words)

    def _store(self, register: Register, words: Sequence[int]) -> None:
        table = self._words[register.table]
        for address, word in enumerate(words, register.address):
            table[address] = word


def _no_reading(register: Register) -> tuple[int, ...]:
    """The register's first sentinel: what this device shows when it has no reading."""
    return register.pattern(next(iter(register.invalid), 0))


def _saturated(register: Register, value: float) -> tuple[int, ...]:
    """`value` as the device would show it: at the end of the type's range when it exceeds it."""
    exact = (value - register.offset) / register.scale
    whole = exact if register.type == "float32" else round(exact)
    return register.pack(min(max(whole, register.lowest), register.highest))
