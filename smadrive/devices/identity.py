"""The identity of a device: the proof of its type, its model, and the registers that distinguish devices of this type.

The identity consists of the registers that the profile names in `[[identify]]`, and of the registers that identify the
variant (a model of the family). A register of `[[identify]]` with ranges must hold a raw value within them; a register
without ranges holds a serial number. Registers that can be written do not belong to the identity, because their values
can change. A device with another identity is another device, even at the same port.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from enum import Enum
from itertools import chain
from types import MappingProxyType, TracebackType

from smadrive.devices.profile.profile import Profile
from smadrive.devices.profile.readings import RegisterReading
from smadrive.devices.profile.schema import IdentityRegister
from smadrive.devices.profile.variants import has_switch, matching, unswitched
from smadrive.errors import DeadlineError, DeviceError, IdentityError, ProtocolError, TransportError

Identity = Mapping[str, float | str]
"""The raw number or the text of each register that identifies the device, by the name of the register."""

UNKNOWN: Identity = MappingProxyType({})


class TypeCheck(Enum):
    """The result of the check of a device's type. ANSWERED: the device answers, but its type cannot be proved."""

    NOT_ASKED = "not asked"
    ANSWERED = "it answers; its type cannot be proved"
    PROVED = "proved"


class IdentityDoubt:
    """A context manager that notes after an exchange if another device may answer from now on.

    is_raised        the identity must be proved again: an exchange failed by silence, an exception reply or a wrong
                     read-back
    has_failed       the last exchange got no right reply: the device was silent, or the reply was wrong
    is_unanswered    the last proof of the identity got no right reply
    """

    def __init__(self) -> None:
        self.is_raised = False
        self.has_failed = False
        self.is_unanswered = False

    def dispel(self) -> None:
        """Reset everything: the identity is proved."""
        self.is_raised = self.has_failed = self.is_unanswered = False

    def __enter__(self) -> None:
        """Do nothing."""

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Note the end of the exchange in the block, with its error. An interruption, such as Ctrl-C, tells nothing."""
        if error is None or isinstance(error, Exception):
            self.has_failed = isinstance(error, (TransportError, ProtocolError))
        if isinstance(error, (DeadlineError, DeviceError)):
            self.is_raised = True


@dataclass(frozen=True, slots=True)
class DeviceType:
    """The type of a device according to its profile, and the result of the check of this type."""

    profile: str
    vendor: str
    check: TypeCheck

    def __str__(self) -> str:
        """Return one line for the user. For a type that is not proved, the line names the rig file as the source."""
        name = f"{self.profile} ({self.vendor})"
        return name if self.check is TypeCheck.PROVED else f"{name}, by the rig file: {self.check.value}"


@dataclass(frozen=True, slots=True)
class ProvedModel:
    """The result of an identity check: the profile of the model, and the identity of the device.

    If `has_switch` is True, a setting of the device (a range switch) can change its model.
    """

    profile: Profile
    identity: Identity
    has_switch: bool


class IdentityCheck:
    """The identity check of a device of `family` at `unit_id`: it names the registers to read, and judges readings."""

    def __init__(self, family: Profile, unit_id: int) -> None:
        self._family = family
        self._where = f"unit {unit_id}"
        self.model_registers = tuple({name: None for variant in family.variants for name in variant.match})
        """Registers whose values determine the variant; empty when all devices have the same registers."""
        proofs = (proof.register_ for proof in family.identify)
        names = tuple(dict.fromkeys(chain(proofs, self.model_registers)))
        self.registers = names or family.measured[:1]
        """Registers to read.

        If the profile names no register for the check, the first measured register is read: the device must answer.
        """

    def judge(self, readings: Mapping[str, RegisterReading], expected: Identity) -> ProvedModel:
        """Return the model that the readings prove; IdentityError if type or identity is another one.

        If a range switch is in an unknown state, the registers that depend on it are invalid in the returned profile.
        The safe state does not need them all, so the device can still be switched off.
        """
        family = self._family
        check_type(family.identify, readings, family.profile.id, self._where)
        identity = identity_of(family, readings)
        check_same(expected, identity, f"{self._where}, a '{family.profile.id}'")
        raws = {name: reading.raw for name, reading in readings.items()}
        variant = matching(family.variants, raws)
        may_switch = has_switch(family.variants, family.registers, raws)
        profile = family if variant is None else family.as_variant(variant)
        if variant is None and may_switch:
            profile = family.model_copy(update={"registers": unswitched(family.variants, family.registers, raws)})
        return ProvedModel(profile, identity, may_switch)


def check_type(
    proofs: Iterable[IdentityRegister], readings: Mapping[str, RegisterReading], profile_id: str, where: str
) -> None:
    """Raise IdentityError if a register of `proofs` reads a raw value outside its ranges."""
    for proof in proofs:
        raw = readings[proof.register_].raw
        if proof.ranges and not any(first <= raw <= last for first, last in proof.ranges):
            raise IdentityError(
                f"the device is not of the type '{profile_id}'",
                where=where,
                value=f"{proof.register_} = {raw}",
                limit=" or ".join(
                    f"{first} to {last}" if first != last else f"{first}" for first, last in proof.ranges
                ),
                cure="check the profile and the unit id in the rig file",
            )


def identity_of(profile: Profile, readings: Mapping[str, RegisterReading]) -> Identity:
    """Return the values of the identifying registers in `readings`, without registers that can be written."""
    telling = {proof.register_ for proof in profile.identify} | {name for one in profile.variants for name in one.match}
    fixed = [name for name in readings if name in telling and not profile.register(name).writable]
    return {name: " ".join(readings[name].words) or readings[name].raw for name in fixed}


def check_same(expected: Identity, found: Identity, where: str) -> None:
    """Raise IdentityError if the identity `found` differs from the `expected` one."""
    for name, value in expected.items():
        if found.get(name) != value:
            raise IdentityError(
                "another device answers now",
                where=where,
                value=f"{name} = {found.get(name)}, was {value}",
                cure="switch the previous device off at its panel. Two adapters may have exchanged their names: write "
                "the names in /dev/serial/by-id into the rig file",
            )
