"""Which requests read a set of registers, and how their replies become readings.

Neighbours are read together, as many as the device allows, and across others that the profile knows: a request costs
more than a few words. A block is always read whole and by itself, so that its values belong together; registers that
say what another one means are read with it.
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
from smadrive.modbus.requests import Request


class RegisterSlice(NamedTuple):
    """One register of a span; its `place` is that among the words of the span, its codec is kept at hand."""

    name: str
    register: Register
    place: slice
    codec: Codec


@dataclass(frozen=True, slots=True)
class RegisterSpan:
    """Registers that are read, or written, in one piece."""

    table: str
    address: int
    count: int
    parts: tuple[RegisterSlice, ...]
    has_dependents: bool

    def words(self, payload: bytes) -> tuple[int, ...]:
        """What the payload of the reply carries."""
        return words_of(self.table, payload, self.count)

    def read_request(self, function_codes: Sequence[int]) -> Request:
        """The request that reads it."""
        return read_request(self.table, self.address, self.count, function_codes)


def plan(profile: Profile, names: Sequence[str]) -> tuple[RegisterSpan, ...]:
    """The spans that hold the registers `names` and all that must be read with them."""
    most = profile.timing.max_read_registers
    loose = _loose_addresses(profile)
    groups: list[list[tuple[str, Register]]] = []
    wanted = ((name, profile.register(name)) for name in _with_company(profile, names))
    for name, register in sorted(wanted, key=lambda item: (item[1].table, item[1].address)):
        group = groups[-1] if groups else []
        if group and _belongs(register, group[0][1], group[-1][1], most, loose):
            group.append((name, register))
        else:
            groups.append([(name, register)])
    return tuple(_span(group) for group in groups)


def decode(
    spans: Iterable[RegisterSpan], words: Iterable[Sequence[int]], names: Sequence[str]
) -> dict[str, RegisterReading]:
    """The readings of `names` out of the words of the spans."""
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


def _with_company(profile: Profile, names: Sequence[str]) -> set[str]:
    """`names`, the registers that say what they mean, and the rest of their blocks with theirs."""
    company = set(names)
    while True:
        blocks = {profile.register(name).block for name in company} - {None}
        more = {other for name in company for other in profile.register(name).depends_on}
        more |= {name for name, register in profile.registers.items() if register.block in blocks}
        if more <= company:
            return company
        company |= more


def _loose_addresses(profile: Profile) -> set[tuple[str, int]]:
    """Table and address of everything that can be read on the way."""
    readable = (register for register in profile.registers.values() if register.access != "w" and not register.block)
    return {(register.table, address) for register in readable for address in register.addresses}


def _belongs(register: Register, first: Register, last: Register, most: int, loose: set[tuple[str, int]]) -> bool:
    if last.table != register.table or last.block != register.block:
        return False
    between = range(last.addresses.stop, register.address)
    bridged = all((register.table, address) in loose for address in between) and not (between and register.block)
    return bridged and register.addresses.stop - first.address <= most


def _span(group: list[tuple[str, Register]]) -> RegisterSpan:
    first, last = group[0][1], group[-1][1]
    parts = tuple(RegisterSlice(name, register, _place(register, first), register.codec) for name, register in group)
    depends_on = any(register.depends_on for _, register in group)
    return RegisterSpan(first.table, first.address, last.addresses.stop - first.address, parts, depends_on)


def _place(register: Register, first: Register) -> slice:
    at = register.address - first.address
    return slice(at, at + register.size)
