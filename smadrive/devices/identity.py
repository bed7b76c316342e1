"""Who a device is: what proves its type, and what tells it from its twin.

Registers named in the profile's `[[identify]]` hold one of some raw values, or any (a serial number). Those that nobody
can write stay the same as long as the device does: they are its identity, and a device whose identity differs is
another one, whatever port leads to it.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from enum import Enum
from types import MappingProxyType

from smadrive.devices.profile.profile import Profile
from smadrive.devices.profile.readings import RegisterReading
from smadrive.devices.profile.schema import IdentityRegister
from smadrive.errors import IdentityError

Identity = Mapping[str, float | str]
"""By register: its raw number, or its text."""

UNKNOWN: Identity = MappingProxyType({})


class Proof(Enum):
    """How far it is known that a device is what the rig file says."""

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
        """One line for the user; what is not proved is said to come from the rig file."""
        name = f"{self.profile} ({self.vendor})"
        return name if self.proof is Proof.PROVED else f"{name}, by the rig file: {self.proof.value}"


def check_type(proofs: Iterable[IdentityRegister], readings: Mapping[str, RegisterReading], who: str) -> None:
    """IdentityError when `who` is of another type than these proofs demand."""
    for proof in proofs:
        raw = readings[proof.register_].raw
        if proof.ranges and not any(first <= raw <= last for first, last in proof.ranges):
            wanted = " or ".join(f"{first} to {last}" for first, last in proof.ranges)
            raise IdentityError(
                f"{who}: {proof.register_} is {raw}, expected {wanted}: check profile and unit id of the rig"
            )


def identity_of(profile: Profile, readings: Mapping[str, RegisterReading]) -> Identity:
    """What these readings say that no device changes of itself."""
    telling = {proof.register_ for proof in profile.identify} | {name for one in profile.variants for name in one.match}
    fixed = [name for name in readings if name in telling and not profile.register(name).writable]
    return {name: " ".join(readings[name].words) or readings[name].raw for name in fixed}


def check_same(known: Identity, found: Identity, who: str) -> None:
    """IdentityError when `who` is not the device that is known."""
    for name, value in known.items():
        if found.get(name) != value:
            raise IdentityError(
                f"{who}: another one answers than before: {name} is {found.get(name)}, was {value}: did two adapters "
                "change their names? Switch the first device off at its panel, and name ports as in /dev/serial/by-id"
            )
