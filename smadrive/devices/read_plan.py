"""The requests that read a set of registers, and the readings in their replies.

Neighbours are read together, as many as the device allows, and across other registers of the profile: a request costs
more than a few words. A block is always read whole and by itself, so that its values belong together. Registers on
which the meaning of another one depends are read with it.
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
    """One register of a span: its `place` among the words of the span, and its codec."""

    name: str
    register: Register
    place: slice
    codec: Codec


@dataclass(frozen=True, slots=True)
class RegisterSpan:
    """Adjacent registers that one request reads or writes."""

    table: str
    address: int
    count: int
    parts: tuple[RegisterSlice, ...]
    has_dependents: bool

    def words(self, payload: bytes) -> tuple[int, ...]:
        """The words in the payload of the reply."""
        return words_of(self.table, payload, self.count)

    def read_request(self, function_codes: Sequence[int]) -> Request:
        """The request that reads the span."""
        return read_request(self.table, self.address, self.count, function_codes)


class RequestPlans:
    """The spans that a device of `profile` needs for each set of registers, computed once a set."""

    def __init__(self, profile: Profile) -> None:
        self._profile = profile
        self._reads: dict[_Names, tuple[RegisterSpan, ...]] = {}
        self._exchanges: dict[tuple[_Names, _Names], tuple[RegisterSpan, RegisterSpan]] = {}

    def read(self, names: _Names) -> tuple[RegisterSpan, ...]:
        """The spans that hold the registers `names` and all that must be read with them."""
        spans = self._reads.get(names)
        if spans is None:
            spans = self._reads[names] = plan(self._profile, names)
        return spans

    def exchange(self, writes: _Names, reads: _Names) -> tuple[RegisterSpan, RegisterSpan]:
        """The span that one FC23 writes and the span that it reads; ConfigError when registers are not adjacent."""
        spans = self._exchanges.get((writes, reads))
        if spans is None:
            for name in writes:
                register = self._profile.register(name)
                if not (register.writable and register.exchangeable):
                    raise ConfigError(
                        "cannot be part of an exchange", where=f"register '{name}'", cure="write it alone"
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
                cure="name adjacent holding registers",
            )
        return spans[0]


def plan(profile: Profile, names: Sequence[str]) -> tuple[RegisterSpan, ...]:
    """The spans that hold the registers `names` and all that must be read with them."""
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


def words_of_register(spans: Iterable[RegisterSpan], words: Iterable[tuple[int, ...]], name: str) -> tuple[int, ...]:
    """The words of one register out of the words of the spans."""
    (found,) = (
        span_words[part.place]
        for span, span_words in zip(spans, words, strict=True)
        for part in span.parts
        if part.name == name
    )
    return found


def _with_related(profile: Profile, names: Sequence[str]) -> set[str]:
    """`names`, the registers on which they depend, and the rest of their blocks with theirs."""
    related = set(names)
    while True:
        blocks = {profile.register(name).block for name in related} - {None}
        more = {other for name in related for other in profile.register(name).depends_on}
        more |= {name for name, register in profile.registers.items() if register.block in blocks}
        if more <= related:
            return related
        related |= more


def _loose_addresses(profile: Profile) -> set[tuple[str, int]]:
    """Table and address of every readable register outside blocks: a request may read across them."""
    readable = (register for register in profile.registers.values() if register.access != "w" and not register.block)
    return {(register.table, address) for register in readable for address in register.addresses}


def _belongs(register: Register, first: Register, last: Register, most: int, loose: set[tuple[str, int]]) -> bool:
    """Whether `register` can be read in the request that reads `first` to `last`."""
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
