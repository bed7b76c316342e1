"""The registers of a simulated device, as its profile describes them. The firmware reads and writes them by role.

The bank checks a whole write before it stores any part, so a request with an exception reply changes nothing. The bank
also follows two rules of the profile. First, some registers hold the decimals or the unit of other registers. Second,
some devices have a lock register: a client must write this register before it writes others.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import isnan
from typing import NamedTuple

from firmware_sim.bus.modbus_exception import ModbusException
from smadrive.devices.profile.dependent_registers import CELSIUS, context_of
from smadrive.devices.profile.profile import Profile
from smadrive.devices.profile.readings import ALONE, Context
from smadrive.devices.profile.register import Register
from smadrive.errors import ConfigError
from smadrive.modbus.verdict import ExceptionCode

Quantity = float | str | None  # a number, the name of a state, or no reading

_NO_REGISTER = -1
"""Marks an address without a register in a table's list of words."""


class RegisterCell:
    """One register of a bank. Its words are part of the list `words`, which holds all words of its table."""

    def __init__(self, name: str, role: str | None, register: Register, words: list[int]) -> None:
        self.name = name
        self.role = role
        self.register = register
        self.codec = register.codec
        self.first = register.address
        self.end = register.addresses.stop
        self.size = register.size
        self.is_dependent = bool(register.depends_on)
        self.keeps = register.access == "rw"
        self._words = words

    @property
    def words(self) -> tuple[int, ...]:
        """The stored words."""
        return tuple(self._words[self.first : self.end])

    def store(self, words: Sequence[int]) -> None:
        """Store `words`. ValueError if their number is not the size of the register."""
        if len(words) != self.size:
            raise ValueError(f"register '{self.name}' has {self.size} words, {len(words)} were stored")
        self._words[self.first : self.end] = words


class Write(NamedTuple):
    """A write of one register: its words, and their value.

    `context` holds the values of the other registers that determine the scale of this register.
    """

    cell: RegisterCell
    words: Sequence[int]
    value: float
    context: Context


class RegisterBank:
    """The registers of `profile`.

    At the start all are zero, except the registers that identify the device; temperatures are in °C.
    """

    def __init__(self, profile: Profile) -> None:
        self._profile = profile
        self._has_locks = bool(profile.write_order)
        self._tables: dict[str, list[int]] = {}
        self._cells: dict[str, RegisterCell] = {}
        self._writable: dict[tuple[str, int], RegisterCell] = {}
        self._published: dict[str, Quantity] = {}
        role_of = {name: role for role, name in profile.roles.model_dump(exclude_none=True).items()}
        for name, register in profile.registers.items():
            words = self._tables.setdefault(register.table, [])
            words += [_NO_REGISTER] * (register.addresses.stop - len(words))
            cell = self._cells[name] = RegisterCell(name, role_of.get(name), register, words)
            cell.store([0] * cell.size)
            if register.writable:
                self._writable[register.table, cell.first] = cell
        self._shown = {
            table: [(cell.role, cell) for cell in self._cells.values() if cell.role and cell.register.table == table]
            for table in self._tables
        }
        for proof in profile.identify:
            if not proof.ranges:
                continue
            cell = self._cells[proof.register_]
            cell.store(cell.codec.pack(proof.ranges[0][0]))
        for name in {register.unit_from for register in profile.registers.values() if register.unit_from}:
            cell = self._cells[name]
            cell.store(_words_for(cell, CELSIUS, ALONE))

    @property
    def tables(self) -> set[str]:
        """The names of the tables that the device has."""
        return set(self._tables)

    def publish(self, quantities: Mapping[str, Quantity], table: str, first: int, count: int) -> None:
        """Store each of the `quantities` in the register of its role.

        Only the registers of `table` that begin within `count` words from the address `first` are updated.
        """
        published, end = self._published, first + count
        for role, cell in self._shown.get(table, ()):
            if first <= cell.first < end and role in quantities:
                value = quantities[role]
                if cell.is_dependent:  # its words depend on other registers, which may change
                    self._show_dependent(cell, value)
                elif role not in published or published[role] != value:
                    cell.store(_words_for(cell, value, ALONE))
                    published[role] = value

    def preset(self, name: str, value: float) -> None:
        """Set the register `name` to `value`. Do nothing if the profile has no such register."""
        if name in self._cells:
            cell = self._cells[name]
            cell.store(cell.codec.saturated(value))

    def read(self, table: str, first: int, count: int) -> list[int]:
        """Return the words of a range as last stored or published. `check_readable` must have accepted the range."""
        return self._tables[table][first : first + count]

    def check_readable(self, table: str, first: int, count: int) -> None:
        """Raise ModbusException when the range contains an address without a register."""
        words = self._tables.get(table, [])[first : first + count]
        if len(words) < count or _NO_REGISTER in words:
            raise ModbusException(ExceptionCode.ILLEGAL_ADDRESS)

    def checked(self, table: str, first: int, words: Sequence[int]) -> list[Write]:
        """Return one Write for each register that `words` fill. ModbusException when a write is not allowed."""
        writes: list[Write] = []
        at = 0
        while at < len(words):
            cell = self._writable.get((table, first + at))
            if cell is None or len(words) < at + cell.size:
                raise ModbusException(ExceptionCode.ILLEGAL_ADDRESS)
            part = words[at : at + cell.size]
            context = self._context(cell)
            writes.append(Write(cell, part, cell.codec.decode(part, context).value, context))
            at += cell.size
        for cell, _, value, context in writes:
            try:
                cell.codec.encode(value, cell.name, context)
            except ConfigError:
                raise ModbusException(ExceptionCode.ILLEGAL_VALUE) from None
            if self._has_locks:
                self._check_unlocked(cell.name)
        return writes

    def by_role(self, writes: Sequence[Write]) -> dict[str, float]:
        """Return the written values by role, without the registers that have no role."""
        return {cell.role: value for cell, _, value, _ in writes if cell.role is not None}

    def store(self, writes: Sequence[Write]) -> None:
        """Store the writes that `checked` returned. The words of a write-only register are not stored."""
        for cell, words, _, _ in writes:
            if cell.keeps:
                cell.store(words)
                self._published.pop(cell.role or "", None)

    def _check_unlocked(self, name: str) -> None:
        for rule in self._profile.write_order:
            if rule.value is None or rule.before not in ("*", name) or rule.write == name:
                continue
            lock = self._cells[rule.write]
            if lock.words != lock.codec.saturated(rule.value):
                raise ModbusException(ExceptionCode.DEVICE_FAILURE)

    def _show_dependent(self, cell: RegisterCell, value: Quantity) -> None:
        """Show `value` in a register that depends on others, and show in its status registers if `value` is valid."""
        for name, valid in cell.register.valid_when.items():
            status = self._cells[name]
            invalid = (number for number in status.register.enum if number not in valid)
            status.store(status.codec.pack(next(invalid, 0) if value is None else valid[0]))
        cell.store(_words_for(cell, value, self._context(cell)))

    def _context(self, cell: RegisterCell) -> Context:
        if not cell.is_dependent:
            return ALONE
        others = (self._cells[name] for name in cell.register.depends_on)
        return context_of(cell.register, {one.name: one.codec.decode(one.words) for one in others})


def _words_for(cell: RegisterCell, value: Quantity, context: Context) -> tuple[int, ...]:
    """Return the words that show `value`: a number scaled, a state as its number or its bit.

    A missing reading is shown as the sentinel whose reason contains "open", otherwise as the first sentinel, or as 0 if
    the register has no sentinel. NaN counts as a missing reading if the register cannot hold NaN.
    """
    register = cell.register
    if isinstance(value, str):
        flags = {1 << bit: word for bit, word in register.bits.items()}
        return cell.codec.pack(next((raw for raw, word in (register.enum | flags).items() if word == value), 0))
    if value is None or (isnan(value) and register.type != "float32"):
        open_patterns = (pattern for pattern, reason in register.invalid.items() if "open" in reason)
        return cell.codec.pattern(next(open_patterns, next(iter(register.invalid), 0)))
    return cell.codec.saturated(value, context)
