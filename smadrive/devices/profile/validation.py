"""Checks of a profile when it is loaded. Everything that could lead to a wrong value or a harmful write is an error."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise

from smadrive.devices.profile.function_codes import read_function, write_function
from smadrive.devices.profile.register import Register
from smadrive.devices.profile.schema import DeviceTiming, Forbidden, IdentityRegister, Roles, SafeWrite, WriteOrder
from smadrive.errors import ConfigError
from smadrive.files.spelling import suggestion_or_list

Registers = Mapping[str, Register]


def refuse_overlaps(registers: Registers) -> None:
    """Raise ValueError if two registers overlap, or if a register lies beyond the last address."""
    for table in ("holding", "input", "coil", "discrete"):
        ordered = sorted((register.address, name) for name, register in registers.items() if register.table == table)
        for (_, before), (address, after) in pairwise(ordered):
            last = registers[before].addresses[-1]
            if address <= last:
                raise ValueError(
                    f"registers.{after}.address {address} overlaps registers.{before}, which ends at {last}: "
                    "correct an address or a type"
                )
        if ordered and (last := registers[ordered[-1][1]].addresses[-1]) > 0xFFFF:
            raise ValueError(f"registers.{ordered[-1][1]} ends at {last}, beyond 65535: correct its address or type")


def refuse_forbidden(registers: Registers, forbidden: tuple[Forbidden, ...]) -> None:
    """Raise ValueError if a writable register lies in a forbidden range."""
    for zone in forbidden:
        for name, register in registers.items():
            inside = register.address <= zone.last and register.addresses[-1] >= zone.first
            if register.writable and register.table == zone.table and inside:
                raise ValueError(
                    f"registers.{name}.access '{register.access}' at address {register.address} writes into the "
                    f"forbidden range {zone.first} to {zone.last} ({zone.reason}): make it access = 'r'"
                )


def refuse_unreachable(registers: Registers, timing: DeviceTiming) -> None:
    """Raise ValueError for a register whose `access` needs a function code that the device lacks.

    ValueError also for a register that is too long for one request.
    """
    codes = timing.function_codes
    for name, register in registers.items():
        if register.access != "w" and read_function(register.table, codes) is None:
            raise ValueError(
                f"registers.{name}: none of timing.function_codes {list(codes)} reads table '{register.table}'"
            )
        if register.writable and write_function(register.table, register.size, codes) is None:
            raise ValueError(
                f"registers.{name}: none of timing.function_codes {list(codes)} writes {register.size} addresses of "
                f"table '{register.table}': make it access = 'r'"
            )
        if register.size > timing.max_read_registers:
            raise ValueError(
                f"registers.{name} has {register.size} words, max_read_registers is {timing.max_read_registers}"
            )
        if register.writable and register.size > timing.max_write_registers:
            raise ValueError(
                f"registers.{name} has {register.size} words, max_write_registers is {timing.max_write_registers}"
            )


def refuse_torn_blocks(registers: Registers, timing: DeviceTiming) -> None:
    """Raise ValueError if one request cannot read a block, because it spans two tables, has a gap, or is too long."""
    for block in sorted({register.block for register in registers.values() if register.block}):
        members = sorted((one for one in registers.values() if one.block == block), key=lambda one: one.address)
        gaps = any(before.addresses.stop != after.address for before, after in pairwise(members))
        size = members[-1].addresses.stop - members[0].address
        if gaps or len({member.table for member in members}) > 1 or size > timing.max_read_registers:
            raise ValueError(
                f"block '{block}' cannot be read in one request: its registers must be adjacent, in one table, and "
                f"occupy at most {timing.max_read_registers} addresses"
            )


def find_register(name: str, registers: Registers, key: str) -> Register:
    """Return the register `name`. ValueError if it does not exist; `key` is the key of the profile that names it."""
    if name not in registers:
        raise ValueError(f"{key} names the unknown register '{name}'; {suggestion_or_list(name, registers)}")
    return registers[name]


def check_proofs(proofs: tuple[IdentityRegister, ...], registers: Registers) -> None:
    """Raise ValueError if a proof names an unknown register, or proves nothing because anyone can write its value."""
    for proof in proofs:
        register = find_register(proof.register_, registers, "identify.register")
        if not proof.ranges and register.writable:
            raise ValueError(
                f"identify: {proof.register_} can be written, so its value proves nothing; it needs ranges"
            )


def check_order(rules: tuple[WriteOrder, ...], registers: Registers) -> None:
    """Raise ValueError if a rule names a register that cannot be written and read back, or lacks a valid value."""
    for rule in rules:
        if rule.before != "*":
            find_register(rule.before, registers, "write_order.before")
        register = find_register(rule.write, registers, "write_order.write")
        if register.access != "rw":
            raise ValueError(f"write_order.write '{rule.write}' has access '{register.access}', but needs 'rw'")
        if rule.value is not None:
            _check_value(register, rule.write, rule.value, "write_order")
        elif rule.before in ("*", rule.write):
            raise ValueError(f"write_order: the rule to write '{rule.write}' before '{rule.before}' needs a value")


def check_safe_state(steps: tuple[SafeWrite, ...], rules: tuple[WriteOrder, ...], registers: Registers) -> None:
    """Raise ValueError if the register of a step has no read-back, rejects the value, or needs another write first."""
    for step in steps:
        register = find_register(step.register_, registers, "safe_state.register")
        if register.access != "rw":
            raise ValueError(
                f"safe_state.register '{step.register_}' has access '{register.access}', but needs 'rw': a safe state "
                "must be confirmed by read-back"
            )
        if any(rule.before == step.register_ and rule.value is None for rule in rules):
            raise ValueError(
                f"safe_state.register '{step.register_}' cannot be written at once, because write_order demands "
                "another write before it"
            )
        _check_value(register, step.register_, step.value, "safe_state")


def check_ends_heat(role: str, steps: tuple[SafeWrite, ...], roles: Roles, registers: Registers) -> None:
    """Raise ValueError if the safe state of a heat source (`role`: heater or supply) does not end all heating.

    It must set the output switch and the current setting to 0, if their registers can be written. The read-back alone
    cannot find such a mistake: it confirms whatever the profile says.
    """
    if not steps:
        raise ValueError(f"a {role} needs [[safe_state]], the writes that end all heating")
    for name in (roles.heater_enable, roles.heater_current):
        if name is None or not registers[name].writable:
            continue
        values = [step.value for step in steps if step.register_ == name]
        if not values or any(values):
            raise ValueError(f"safe_state must set '{name}' to 0 and to no other value, to end the heating of a {role}")


def _check_value(register: Register, name: str, value: float, key: str) -> None:
    try:
        register.codec.encode(value, name)
    except ConfigError as error:
        raise ValueError(f"{key}: {error}") from None
