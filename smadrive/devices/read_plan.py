"""The requests that read a set of registers, and the readings in their replies.

One request reads as many neighbouring registers as the device allows, also across registers that are not needed:
another request takes more time than a few more words. Registers with the same `block` in the profile are always read
together and without others, so that their values belong to the same moment. If the meaning of a register depends on
other registers, these are read, too.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from smadrive.devices.profile.codec import Codec
from smadrive.devices.profile.dependent_registers import context_of
from smadrive.devices.profile.function_codes import read_request, words_of
from smadrive.devices.profile.profile import Profile
from smadrive.devices.profile.readings import RegisterReading
from smadrive.devices.profile.register import Register
from smadrive.errors import ConfigError
from smadrive.modbus.requests import Request

_Names = tuple[str, ...]


class RegisterSlice(NamedTuple):
    """One register of a RegisterSpan. `place` is the slice of the span's words that belongs to the register."""

    name: str
    register: Register
    place: slice
    codec: Codec


@dataclass(frozen=True, slots=True)
class RegisterSpan:
    """Adjacent addresses that one request reads or writes, and the registers in them (`parts`).

    `has_dependents` is True if the meaning of one of these registers depends on another register.
    """

    table: str
    address: int
    count: int
    parts: tuple[RegisterSlice, ...]
    has_dependents: bool

    def words(self, payload: bytes) -> tuple[int, ...]:
        """Return the 16-bit words in the payload of the reply; a coil or discrete input is one word, 0 or 1."""
        return words_of(self.table, payload, self.count)

    def read_request(self, function_codes: Sequence[int]) -> Request:
        """Return the request that reads the span."""
        return read_request(self.table, self.address, self.count, function_codes)


class RequestPlans:
    """Computes the spans that requests to a device of `profile` need, and caches them for each set of registers."""

    def __init__(self, profile: Profile) -> None:
        self._profile = profile
        self._reads: dict[_Names, tuple[RegisterSpan, ...]] = {}
        self._exchanges: dict[tuple[_Names, _Names], tuple[RegisterSpan, RegisterSpan]] = {}

    def read(self, names: _Names) -> tuple[RegisterSpan, ...]:
        """Return the spans that contain the registers `names`, and all registers read together with them."""
        spans = self._reads.get(names)
        if spans is None:
            spans = self._reads[names] = plan(self._profile, names)
        return spans

    def exchange(self, writes: _Names, reads: _Names) -> tuple[RegisterSpan, RegisterSpan]:
        """Return the span that one FC23 request writes, and the span that it reads.

        ConfigError when one request cannot write or read the registers: a register is not writable, not exchangeable or
        not a holding register, the registers are too far apart, or there is a gap between written registers.
        """
        spans = self._exchanges.get((writes, reads))
        if spans is None:
            for name in writes:
                register = self._profile.register(name)
                if not (register.writable and register.exchangeable):
                    raise ConfigError(
                        "cannot be part of an exchange", where=f"register '{name}'", cure="write this register alone"
                    )
            spans = self._one(writes, "written"), self._one(reads, "read")
            self._exchanges[writes, reads] = spans
        return spans

    def _one(self, names: _Names, verb: str) -> RegisterSpan:
        spans = self.read(names)
        sizes = sum(part.register.size for part in spans[0].parts)
        torn = len(spans) != 1 or (verb == "written" and spans[0].count > sizes)
        if torn or spans[0].table != "holding":
            raise ConfigError(
                f"cannot be {verb} in one request",
                where=f"'{self._profile.profile.id}'",
                value=", ".join(names),
                cure="use holding registers that are close together. Between registers to write there must be no gap",
            )
        return spans[0]


def plan(profile: Profile, names: Sequence[str]) -> tuple[RegisterSpan, ...]:
    """Return the spans with the registers `names` and all registers that must be read with them."""
    most = profile.timing.max_read_registers
    loose = _loose_addresses(profile)
    groups: list[list[tuple[str, Register]]] = []
    needed = ((name, profile.register(name)) for name in _with_related(profile, names))
    for name, register in sorted(needed, key=lambda item: (item[1].table, item[1].address)):
        group = groups[-1] if groups else []
        if group and _belongs(register, group[0][1], group[-1][1], most, loose):
            group.append((name, register))
        else:
            groups.append([(name, register)])
    return tuple(_span(group) for group in groups)


def decode(
    spans: Iterable[RegisterSpan], words: Iterable[Sequence[int]], names: Sequence[str]
) -> dict[str, RegisterReading]:
    """Return the readings of `names`, decoded from the words of the spans."""
    readings: dict[str, RegisterReading] = {}
    later: list[tuple[str, Register, Sequence[int]]] = []
    for span, span_words in zip(spans, words, strict=True):
        for name, register, place, codec in span.parts:
            if span.has_dependents and register.depends_on:
                later.append((name, register, span_words[place]))
            else:
                readings[name] = codec.decode(span_words[place])
    for name, register, part in later:
        readings[name] = register.codec.decode(part, context_of(register, readings))
    return readings if len(readings) == len(names) else {name: readings[name] for name in names}


def words_of_register(spans: Iterable[RegisterSpan], words: Iterable[tuple[int, ...]], name: str) -> tuple[int, ...]:
    """Return the words of one register, taken from the words of the spans."""
    (found,) = (
        span_words[part.place]
        for span, span_words in zip(spans, words, strict=True)
        for part in span.parts
        if part.name == name
    )
    return found


def _with_related(profile: Profile, names: Sequence[str]) -> set[str]:
    """Return `names`, the registers on which they depend, and all registers that share a block with one of these."""
    related = set(names)
    while True:
        blocks = {profile.register(name).block for name in related} - {None}
        more = {other for name in related for other in profile.register(name).depends_on}
        more |= {name for name, register in profile.registers.items() if register.block in blocks}
        if more <= related:
            return related
        related |= more


def _loose_addresses(profile: Profile) -> set[tuple[str, int]]:
    """Return table and address of every readable register outside blocks. A request may read across them."""
    readable = (register for register in profile.registers.values() if register.access != "w" and not register.block)
    return {(register.table, address) for register in readable for address in register.addresses}


def _belongs(register: Register, first: Register, last: Register, most: int, loose: set[tuple[str, int]]) -> bool:
    """Return True if the request that reads `first` to `last` can also read `register`.

    most     largest number of addresses in a request
    loose    table and address of registers that are not needed, but may be read, too
    """
    if last.table != register.table or last.block != register.block:
        return False
    between = range(last.addresses.stop, register.address)
    bridged = all((register.table, address) in loose for address in between) and not (between and register.block)
    return bridged and register.addresses.stop - first.address <= most


def _span(group: list[tuple[str, Register]]) -> RegisterSpan:
    first, last = group[0][1], group[-1][1]
    parts = tuple(RegisterSlice(name, register, _place(register, first), register.codec) for name, register in group)
    has_dependents = any(register.depends_on for _, register in group)
    return RegisterSpan(first.table, first.address, last.addresses.stop - first.address, parts, has_dependents)


def _place(register: Register, first: Register) -> slice:
    at = register.address - first.address
    return slice(at, at + register.size)
