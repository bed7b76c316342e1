"""Models of one family. Their registers differ in address, scale, offset or limits, or are absent in some models.

A channel array `tc` of count 8 is eight registers `tc_0` to `tc_7`; an override of `tc` applies to all of them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import combinations

from pydantic import ValidationError

from smadrive.devices.profile.register import Register
from smadrive.devices.profile.schema import Variant
from smadrive.files.spelling import suggestion_or_list


def expanded(registers: Mapping[str, Register]) -> dict[str, Register]:
    """Return the registers. Each channel of an array becomes a register of its own, numbered from 0."""
    channels = {}
    for name, register in registers.items():
        step = register.stride or register.size
        for index in range(register.count):
            shifted = register.model_copy(update={"address": register.address + index * step})
            channels[name if register.count == 1 else f"{name}_{index}"] = shifted
    return channels


def applied(registers: Mapping[str, Register], variant: Variant) -> dict[str, Register]:
    """Return the registers of this variant; ValueError for an unknown or an invalid register."""
    changed = dict(registers)
    for target, override in variant.registers.items():
        names = [name for name, register in registers.items() if target in (name, _array_of(name, register))]
        if not names:
            raise ValueError(f"variants: registers.{target} is not a register; {suggestion_or_list(target, registers)}")
        for name in names:
            tables = registers[name].model_dump(exclude_unset=True) | override.model_dump(exclude_none=True)
            try:
                changed[name] = Register.model_validate(tables)
            except ValidationError as error:
                complaint = error.errors()[0]["msg"].removeprefix("Value error, ")
                raise ValueError(f"variants: registers.{target}: {complaint}") from None
    for name in variant.absent:
        if changed.pop(name, None) is None:
            raise ValueError(f"variants: absent {name} is not a register; {suggestion_or_list(name, registers)}")
    return changed


def matching(variants: Sequence[Variant], raws: Mapping[str, float]) -> Variant | None:
    """Return the first variant whose `match` fits the raw values; None if no variant fits."""
    for variant in variants:
        if variant.match and all(first <= raws[name] <= last for name, (first, last) in variant.match.items()):
            return variant
    return None


def has_switch(variants: Sequence[Variant], registers: Mapping[str, Register], raws: Mapping[str, float]) -> bool:
    """Return True if a setting (a range switch) can change the device with these raw values to another variant."""
    return any(_switches(variant, registers) for variant in _reachable(variants, registers, raws))


def unswitched(
    variants: Sequence[Variant], registers: Mapping[str, Register], raws: Mapping[str, float]
) -> dict[str, Register]:
    """Return the registers of a device whose setting (a range switch) is in a state that no variant has.

    The registers that depend on the setting are never valid, because their scales and limits are unknown.
    """
    changed = dict(registers)
    for variant in _reachable(variants, registers, raws):
        never: dict[str, tuple[int, ...]] = dict.fromkeys(_switches(variant, registers), ())
        after = applied(registers, variant)
        for name in (name for name, register in registers.items() if never and after.get(name) is not register):
            table = registers[name].model_dump(exclude_unset=True) | {"valid_when": never}
            changed[name] = Register.model_validate(table)
    return changed


def _switches(variant: Variant, registers: Mapping[str, Register]) -> list[str]:
    """Return the registers of `match` that can be written, so that their values can change."""
    return [name for name in variant.match if registers[name].writable]


def _reachable(
    variants: Sequence[Variant], registers: Mapping[str, Register], raws: Mapping[str, float]
) -> list[Variant]:
    """Return the variants that the device with these raw values can be in some state of its settings."""

    def may_hold(name: str, span: tuple[int, int]) -> bool:
        return registers[name].writable or span[0] <= raws[name] <= span[1]

    return [variant for variant in variants if all(may_hold(name, span) for name, span in variant.match.items())]


def refuse_ambiguity(variants: Sequence[Variant]) -> None:
    """Raise ValueError if one device could match two variants, or if two variants have the same `choice`."""
    for one, other in combinations((variant for variant in variants if variant.match), 2):
        shared = one.match.keys() & other.match.keys()
        if all(_overlap(one.match[name], other.match[name]) for name in shared):
            raise ValueError(f"variants: {one.match} and {other.match} match the same device: make the ranges differ")
    choices = [variant.choice for variant in variants if variant.choice]
    if len(set(choices)) < len(choices):
        raise ValueError(f"variants: a choice occurs twice among {', '.join(choices)}")


def _overlap(one: tuple[int, int], other: tuple[int, int]) -> bool:
    return one[0] <= other[1] and other[0] <= one[1]


def _array_of(name: str, register: Register) -> str | None:
    return name.rpartition("_")[0] if register.count > 1 else None
