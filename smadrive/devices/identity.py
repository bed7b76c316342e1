"""The identity of a device: the proof of its type, its model, and the registers that distinguish it from its twin.

Registers named in the profile's `[[identify]]` hold one of some raw values, or any value (a serial number). Registers
that cannot be written stay the same as long as the device does: they are its identity. A device whose identity differs
is another device, at whatever port it answers.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from enum import Enum
from itertools import chain
from types import MappingProxyType

from smadrive.devices.profile.profile import Profile
from smadrive.devices.profile.readings import RegisterReading
from smadrive.devices.profile.schema import IdentityRegister
from smadrive.devices.profile.variants import has_switch, matching
from smadrive.errors import IdentityError

Identity = Mapping[str, float | str]
"""By register: its raw number, or its text."""

UNKNOWN: Identity = MappingProxyType({})


class Proof(Enum):
    """How far the type of a device is proved."""

    NOT_ASKED = "not asked"
    ANSWERED = "it answers; its type cannot be proved"
    PROVED = "proved"


@dataclass(frozen=True, slots=True)
class DeviceType:
    """The type of a device by its profile, and the proof that this device gave."""

    profile: str
    vendor: str
    proof: Proof

    def __str__(self) -> str:
        """One line for the user; a type that is not proved is attributed to the rig file."""
        name = f"{self.profile} ({self.vendor})"
        return name if self.proof is Proof.PROVED else f"{name}, by the rig file: {self.proof.value}"


@dataclass(frozen=True, slots=True)
class ProvedModel:
    """The result of an identity check: the profile of the model, and the identity of the device.

    `has_switch`: a setting of the device (a range switch) can make another model of it.
    """

    profile: Profile
    identity: Identity
    has_switch: bool


class IdentityCheck:
    """The identity check of a device of `family` at `unit_id`: the registers to read, and the judgement of them."""

    def __init__(self, family: Profile, unit_id: int) -> None:
        self._family = family
        self._where = f"unit {unit_id}"
        self.model_registers = tuple({name: None for variant in family.variants for name in variant.match})
        """Registers whose values decide which variant the device is; empty: all devices have the same registers."""
        proofs = (proof.register_ for proof in family.identify)
        names = tuple(dict.fromkeys(chain(proofs, self.model_registers)))
        self.registers = names or family.measured[:1]
        """Registers to read. Where none proves the type, a measured one: the device must answer at least."""

    def judge(self, readings: Mapping[str, RegisterReading], expected: Identity) -> ProvedModel:
        """The model with these readings; IdentityError for another type, or another device than the `expected` one."""
        family = self._family
        check_type(family.identify, readings, family.profile.id, self._where)
        identity = identity_of(family, readings)
        check_same(expected, identity, f"{self._where}, a '{family.profile.id}'")
        raws = {name: reading.raw for name, reading in readings.items()}
        variant = matching(family.variants, raws)
        profile = family if variant is None else family.as_variant(variant)
        return ProvedModel(profile, identity, has_switch(family.variants, family.registers, raws))


def check_type(
    proofs: Iterable[IdentityRegister], readings: Mapping[str, RegisterReading], profile_id: str, where: str
) -> None:
    """IdentityError when a reading lies outside the ranges of the type."""
    for proof in proofs:
        raw = readings[proof.register_].raw
        if proof.ranges and not any(first <= raw <= last for first, last in proof.ranges):
            raise IdentityError(
                f"is no '{profile_id}'",
                where=where,
                value=f"{proof.register_} = {raw}",
                limit=" or ".join(
                    f"{first} to {last}" if first != last else f"{first}" for first, last in proof.ranges
                ),
                cure="check profile and unit id of the rig",
            )


def identity_of(profile: Profile, readings: Mapping[str, RegisterReading]) -> Identity:
    """The registers among these readings that nothing can change, with their values."""
    telling = {proof.register_ for proof in profile.identify} | {name for one in profile.variants for name in one.match}
    fixed = [name for name in readings if name in telling and not profile.register(name).writable]
    return {name: " ".join(readings[name].words) or readings[name].raw for name in fixed}


def check_same(expected: Identity, found: Identity, where: str) -> None:
    """IdentityError when the device that was `found` is not the `expected` one."""
    for name, value in expected.items():
        if found.get(name) != value:
            raise IdentityError(
                "another device answers than before",
                where=where,
                value=f"{name} = {found.get(name)}, was {value}",
                cure="switch the first device off at its panel, and name ports as in /dev/serial/by-id: two adapters "
                "may have changed their names",
            )
