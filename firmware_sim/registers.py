"""The register bank of a simulated device: any profile, filled and read by role.

A write is checked whole before any of it takes effect: a request that is refused has changed nothing. What the profile
tells of the device holds here too: decimals and unit held in registers, and the lock that a write must open first.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from firmware_sim.refusal import DEVICE_FAILURE, ILLEGAL_ADDRESS, ILLEGAL_VALUE, Refusal
from smadrive.device.companions import context_of
from smadrive.device.profile import Profile
from smadrive.device.readings import ALONE, Context
from smadrive.device.registers import Register
from smadrive.errors import ConfigError

Quantity = float | str | None  # a number, the name of a state, or no reading

_NOWHERE = -1
"""In the place of a word, by its address: the device has none there."""


class Write(NamedTuple):
    """One register about to be written: its words, and what they mean."""

    name: str
    register: Register
    words: Sequence[int]
    value: float
    context: Context


class RegisterBank:
    """The registers of `profile`, all zero but those that prove its identity."""

    def __init__(self, profile: Profile) -> None:
        self._profile = profile
        self._has_locks = bool(profile.write_order)
        self._words: dict[str, list[int]] = {}
        self._writable: dict[tuple[str, int], tuple[str, Register]] = {}
        self._roles: dict[str, list[tuple[int, str, Register]]] = {}
        self._published: dict[str, Quantity] = {}
        self._role_of = {name: role for role, name in profile.roles.model_dump(exclude_none=True).items()}
        for name, register in profile.registers.items():
            words = self._words.setdefault(register.table, [])
            words += [_NOWHERE] * (register.addresses.stop - len(words))
            words[register.address : register.addresses.stop] = [0] * register.size
            if register.writable:
                self._writable[register.table, register.address] = (name, register)
            if name in self._role_of:
                entry = (register.address, self._role_of[name], register)
                self._roles.setdefault(register.table, []).append(entry)
        for proof in profile.identify:
            register = profile.register(proof.register_)
            self._store(register, register.codec.pack(proof.ranges[0][0]))

    @property
    def tables(self) -> set[str]:
        """The tables that the device has."""
        return set(self._words)

    def publish(self, quantities: Mapping[str, Quantity], table: str, first: int, count: int) -> None:
        """Refresh the registers of these roles that lie in a range about to be read."""
        published, end = self._published, first + count
        for address, role, register in self._roles.get(table, ()):
            if first <= address < end and role in quantities:
                value = quantities[role]
                if register.companions:  # other registers say how it shows, and may change
                    self._show_in_company(register, value)
                elif role not in published or published[role] != value:
                    self._store(register, _shown(register, value, ALONE))
                    published[role] = value

    def preset(self, name: str, value: float) -> None:
        """Set a register that no role fills; a profile without it is none the worse."""
        if name in self._profile.registers:
            register = self._profile.register(name)
            self._store(register, register.codec.saturated(value))

    def read(self, table: str, first: int, count: int) -> list[int]:
        """The words, as they were last stored or published, of a range that is readable."""
        return self._words[table][first : first + count]

    def check_readable(self, table: str, first: int, count: int) -> None:
        """Refusal when one of the words does not exist."""
        words = self._words.get(table, [])[first : first + count]
        if len(words) < count or _NOWHERE in words:
            raise Refusal(ILLEGAL_ADDRESS)

    def checked(self, table: str, first: int, words: Sequence[int]) -> list[Write]:
        """The writes of whole registers that `words` make up; Refusal when one of them cannot be carried out."""
        writes: list[Write] = []
        at = 0
        while at < len(words):
            name, register = self._writable.get((table, first + at), ("", None))
            if register is None or len(part := words[at : at + register.size]) < register.size:
                raise Refusal(ILLEGAL_ADDRESS)
            context = self._context(register)
            writes.append(Write(name, register, part, register.codec.decode(part, context).value, context))
            at += register.size
        for write in writes:
            try:
                write.register.codec.encode(write.value, write.name, write.context)
            except ConfigError:
                raise Refusal(ILLEGAL_VALUE) from None
            if self._has_locks:
                self._check_unlocked(write.name)
        return writes

    def by_role(self, writes: Sequence[Write]) -> dict[str, float]:
        """The values of those writes whose register plays a role."""
        return {self._role_of[write.name]: write.value for write in writes if write.name in self._role_of}

    def store(self, writes: Sequence[Write]) -> None:
        """Carry out checked writes; a write-only register keeps nothing."""
        for write in writes:
            if write.register.access == "rw":
                self._store(write.register, write.words)
                self._published.pop(self._role_of.get(write.name, ""), None)

    def _check_unlocked(self, name: str) -> None:
        for rule in self._profile.write_order:
            if rule.value is None or rule.before not in ("*", name) or rule.write == name:
                continue
            lock = self._profile.register(rule.write)
            if self._words_of(lock) != lock.codec.saturated(rule.value):
                raise Refusal(DEVICE_FAILURE)

    def _show_in_company(self, register: Register, value: Quantity) -> None:
        """Show a quantity as its companions say, and in those that tell it whether it is valid."""
        for name, allowed in register.valid_when.items():
            teller = self._profile.register(name)
            denied = (number for number in teller.enum if number not in allowed)
            self._store(teller, teller.codec.pack(next(denied, 0) if value is None else allowed[0]))
        self._store(register, _shown(register, value, self._context(register)))

    def _context(self, register: Register) -> Context:
        if not register.companions:
            return ALONE
        named = {name: self._profile.register(name) for name in register.companions}
        return context_of(register, {name: one.codec.decode(self._words_of(one)) for name, one in named.items()})

    def _words_of(self, register: Register) -> tuple[int, ...]:
        return tuple(self._words[register.table][register.address : register.addresses.stop])

    def _store(self, register: Register, words: Sequence[int]) -> None:
        first = register.address
        self._words[register.table][first : first + len(words)] = words


def _shown(register: Register, value: Quantity, context: Context) -> tuple[int, ...]:
    """No reading as the sentinel that says "open" (or the first), a state by its number or its bit."""
    if isinstance(value, int | float):
        return register.codec.saturated(value, context)
    if value is None:
        opens = (bits for bits, reason in register.invalid.items() if "open" in reason)
        return register.codec.pattern(next(opens, next(iter(register.invalid), 0)))
    flags = {1 << bit: word for bit, word in register.bits.items()}
    return register.codec.pack(next((raw for raw, word in (register.enum | flags).items() if word == value), 0))
