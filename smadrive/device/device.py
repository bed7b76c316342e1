"""A device on the bus, spoken to by register names and in engineering units.

Nothing is written before the identity is proved, and no write is believed before it is read back.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from smadrive.device.profile import Profile
from smadrive.device.registers import Reading, Register
from smadrive.errors import ConfigError, ExceptionReply, IdentityError, ProtocolError, ReadBackError, TransportError
from smadrive.modbus import requests
from smadrive.modbus.master import Master

SAFE_STATE_ATTEMPTS = 5


@dataclass(frozen=True, slots=True)
class _Span:
    """Registers that are read, or written, in one piece."""

    table: str
    address: int
    count: int
    parts: tuple[tuple[str, Register, int], ...]  # name, register, place in the span

    def decode(self, words: Sequence[int]) -> dict[str, Reading]:
        return {name: register.decode(words[at : at + register.size]) for name, register, at in self.parts}


class Device:
    """One device of type `profile` at `unit_id` (the profile's own if None) behind `master`."""

    def __init__(self, profile: Profile, master: Master, unit_id: int | None = None) -> None:
        """Nothing is sent yet. ConfigError when no single device can have `unit_id`."""
        if unit_id is not None and not 1 <= unit_id <= 247:
            raise ConfigError(f"unit_id {unit_id} is outside 1 to 247")
        self.profile = profile
        self.master = master
        self.unit_id = profile.serial.unit_id if unit_id is None else unit_id
        self._timing = profile.bus_timing()
        self._identified = False
        self._spans: dict[tuple[str, ...], tuple[_Span, ...]] = {}

    def check_identity(self) -> None:
        """Prove that the device is the one that the profile describes; IdentityError if not."""
        for proof in self.profile.identify:
            raw = self.read((proof.register_,))[proof.register_].raw
            if not any(first <= raw <= last for first, last in proof.ranges):
                wanted = " or ".join(f"{first} to {last}" for first, last in proof.ranges)
                raise IdentityError(
                    f"unit {self.unit_id} is no '{self.profile.profile.id}': {proof.register_} is {raw}, expected "
                    f"{wanted}: check profile and unit id of the rig"
                )
        self._identified = True

    def read(self, names: Sequence[str]) -> dict[str, Reading]:
        """The registers `names`, in as few requests as their addresses allow."""
        readings: dict[str, Reading] = {}
        for span in self._spans_of(tuple(names)):
            read = requests.read_holding if span.table == "holding" else requests.read_input
            payload = self.master.execute(self.unit_id, read(span.address, span.count), self._timing)
            readings |= span.decode(requests.registers_of(payload))
        return readings

    def write(self, name: str, value: float) -> None:
        """Write one register and read it back (unless it is write-only); ReadBackError when it did not arrive."""
        register = self._writable(name)
        words = register.encode(value, name)
        self._prove_identity()
        if len(words) == 1:
            request = requests.write_register(register.address, words[0])
        else:
            request = requests.write_registers(register.address, words)
        try:
            self.master.execute(self.unit_id, request, self._timing)
        except ExceptionReply as refusal:
            raise ExceptionReply(f"register '{name}' = {value:g} {register.unit}: {refusal}", refusal.code) from None
        if register.access == "rw":
            self._confirm(name, words)

    def exchange(self, writes: Mapping[str, float], reads: Sequence[str]) -> dict[str, Reading]:
        """Write adjacent registers, then read adjacent registers, in one FC23 transaction; never retried."""
        (target,) = self._one_span(tuple(writes), "written")
        (source,) = self._one_span(tuple(reads), "read")
        words: list[int] = []
        for name, _, _ in target.parts:
            words += self._writable(name).encode(writes[name], name)
        self._prove_identity()
        request = requests.exchange(target.address, words, source.address, source.count)
        return source.decode(requests.registers_of(self.master.execute(self.unit_id, request, self._timing)))

    def enter_safe_state(self) -> None:
        """Write the profile's safe state, confirmed by read-back; tried again on a bad bus, then raises the error."""
        for attempt in range(1, SAFE_STATE_ATTEMPTS + 1):
            try:
                for step in self.profile.safe_state:
                    self.write(step.register_, step.value)
            except (TransportError, ProtocolError, ExceptionReply, ReadBackError):
                if attempt == SAFE_STATE_ATTEMPTS:
                    raise
            else:
                return

    def _prove_identity(self) -> None:
        if not self._identified:
            self.check_identity()

    def _confirm(self, name: str, words: tuple[int, ...]) -> None:
        register = self.profile.register(name)
        payload = self.master.execute(
            self.unit_id, requests.read_holding(register.address, register.size), self._timing
        )
        found = requests.registers_of(payload)
        if found != words:
            raise ReadBackError(
                f"unit {self.unit_id}, register '{name}': wrote {register.decode(words).value:g} {register.unit}, "
                f"reads back {register.decode(found).value:g} {register.unit}: is the device locked or in a fault?"
            )

    def _writable(self, name: str) -> Register:
        register = self.profile.register(name)
        if not register.writable:
            raise ConfigError(f"register '{name}' of '{self.profile.profile.id}' cannot be written (access 'r')")
        return register

    def _one_span(self, names: tuple[str, ...], verb: str) -> tuple[_Span, ...]:
        spans = self._spans_of(names)
        if len(spans) != 1 or spans[0].table != "holding":
            raise ConfigError(
                f"'{self.profile.profile.id}': {', '.join(names)} cannot be {verb} in one request: they must be "
                "adjacent holding registers"
            )
        return spans

    def _spans_of(self, names: tuple[str, ...]) -> tuple[_Span, ...]:
        spans = self._spans.get(names)
        if spans is None:
            spans = self._spans[names] = _plan(self.profile, names)
        return spans


def _plan(profile: Profile, names: tuple[str, ...]) -> tuple[_Span, ...]:
    """Adjacent registers together, no more in one request than the device can."""
    most = profile.timing.max_read_registers
    groups: list[list[tuple[str, Register]]] = []
    registers = sorted(((profile.register(name), name) for name in names), key=lambda item: _place(item[0]))
    for register, name in registers:
        group = groups[-1] if groups else []
        adjacent = group and group[-1][1].table == register.table and group[-1][1].addresses.stop == register.address
        if adjacent and register.addresses.stop - group[0][1].address <= most:
            group.append((name, register))
        else:
            groups.append([(name, register)])
    return tuple(_span(group) for group in groups)


def _place(register: Register) -> tuple[str, int]:
    return register.table, register.address


def _span(group: list[tuple[str, Register]]) -> _Span:
    first, last = group[0][1], group[-1][1]
    parts = tuple((name, register, register.address - first.address) for name, register in group)
    return _Span(first.table, first.address, last.addresses.stop - first.address, parts)
