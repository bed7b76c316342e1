"""A device on the bus, used by register names and in engineering units.

Nothing is written before the identity of the device is proved. `write` reads the register back if it can be read. A
new connection may lead to another device (two USB adapters may have exchanged their names), so the device must prove
its identity again. If the models of a family have different registers, the model must be known before a read, too. If a
setting of the device changes the registers (a range switch), the driver reads this setting again before every write.

A proof of the identity is valid until the connection is lost, or until an exchange fails (silence, an exception reply
or a wrong read-back): then another device may be there. Without a valid proof, these steps first check the identity:

    read a register     only if the registers depend on the model, or an identity has been found before
    encode a write      only if the registers depend on the model (with a range switch: even with a valid proof)
    send a write        always

The safe state counts as confirmed after one more check of the identity, if registers can prove it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from math import inf

from smadrive.devices.identity import UNKNOWN, Identity, IdentityCheck, IdentityDoubt, TypeCheck
from smadrive.devices.profile.codec import down
from smadrive.devices.profile.profile import Profile
from smadrive.devices.profile.readings import RegisterReading
from smadrive.devices.read_plan import decode, words_of_register
from smadrive.devices.register_access import RegisterAccess, RegisterWrite
from smadrive.devices.retry import retry_all
from smadrive.errors import ConfigError, IdentityError, ProtocolError, TransportError
from smadrive.modbus import requests
from smadrive.modbus.client import ModbusClient

_REFUTED = -1  # no connection has this number; `_proved_on` holds it after another device has answered


class Device:
    """A device of type `profile` at `unit_id` on the bus of `client`.

    unit_id         None: the unit id in the profile
    read_retries    number of retries of a read; None: `retries` of the profile. Periodic pollers set 0
    identity        the identity that the device must have; UNKNOWN: the identity that the device shows first
    """

    def __init__(
        self,
        profile: Profile,
        client: ModbusClient,
        unit_id: int | None = None,
        read_retries: int | None = None,
        identity: Identity = UNKNOWN,
    ) -> None:
        """Nothing is sent yet. ConfigError when `unit_id` cannot belong to a single device."""
        lowest, highest = (1, 247) if profile.profile.protocol == "modbus-rtu" else (0, 255)
        if unit_id is not None and not lowest <= unit_id <= highest:
            what, limit = "is not the unit id of a single device", f"{lowest} to {highest}"
            raise ConfigError(what, where="unit_id", value=unit_id, limit=limit)
        timing = profile.bus_timing()
        timing = timing if read_retries is None else replace(timing, read_retries=read_retries)
        self.client = client
        self.clock = client.clock
        self.unit_id = profile.unit_id if unit_id is None else unit_id
        self.identity = identity
        self.type_check = TypeCheck.NOT_ASKED
        self._type_if_checked = TypeCheck.PROVED if profile.proves_type else TypeCheck.ANSWERED
        self._check = IdentityCheck(profile, self.unit_id)
        self._registers = RegisterAccess(profile, client, self.unit_id, timing)
        self._has_switch = False
        self._proved_on: int | None = None
        self._doubt = IdentityDoubt()
        self._written: set[str] = set()
        self._commanded: dict[str, RegisterWrite] = {}
        self._safe_writes: dict[str, RegisterWrite] = {}

    @property
    def profile(self) -> Profile:
        """The profile of the device. Once the identity is proved, it is the profile of the proved model."""
        return self._registers.profile

    def check_identity(self) -> None:
        """Prove that the profile describes the device, and find its model; IdentityError if the proof fails.

        The first check gives the device time to start (`patience_s`). Every later check requires the same device.
        """
        connection, names = self.client.connection, self._check.registers
        first = self._proved_on is None
        self._doubt.is_unanswered = False
        try:
            readings = self._registers.read_patiently(names) if first else self._registers.read(names, proved=True)
        except (TransportError, ProtocolError):
            self._doubt.is_unanswered = True
            raise
        try:
            model = self._check.judge(readings, self.identity)
        except IdentityError:
            self._proved_on = _REFUTED
            raise
        self._registers.use(model.profile)
        self._has_switch, self.identity = model.has_switch, model.identity
        self.type_check, self._proved_on = self._type_if_checked, connection
        self._doubt.dispel()

    def read(self, names: Sequence[str], *, proved: bool = False, within_s: float = inf) -> dict[str, RegisterReading]:
        """Read the registers `names` in as few requests as possible, and return their readings.

        Plain Modbus RTU cannot distinguish a second copy of the previous reply from a new reply of equal length.
        `proved` excludes such copies with one more transaction: the device must first answer a request of another
        length. Set it where a safety decision depends on the readings. `within_s` is that of `command`.
        """
        with self._doubt, self._registers.within(within_s):
            if self._check.model_registers or self.identity:
                self._prove_identity()
            return self._registers.read(tuple(names), proved=proved)

    def write(self, name: str, value: float) -> None:
        """Write one register and read it back, if it can be read. ReadBackError when it reads another value."""
        with self._doubt:
            self._prove_model()
            self._write(self._registers.encode(name, value))

    def exchange(self, writes: Mapping[str, float], reads: Sequence[str]) -> dict[str, RegisterReading]:
        """Write `writes` and read `reads` in one FC23 transaction, and return the readings by name.

        Values are rounded down. Nothing is retried. ConfigError when one request cannot write or read these registers.
        """
        with self._doubt:
            self._prove_model()
            target, source = self._registers.plans.exchange(tuple(writes), tuple(reads))
            words = [
                word for name, _, _, codec in target.parts for word in codec.encode(writes[name], name, rounding=down)
            ]
            request = requests.exchange(target.address, words, source.address, source.count)
            self._prove_identity()
            return decode((source,), (source.words(self._registers.execute(request, self._proved_on)),), reads)

    def command(
        self, name: str, value: float, reads: Sequence[str], *, proved: bool = False, within_s: float = inf
    ) -> dict[str, RegisterReading]:
        """Read `reads`, then write `value` to the register `name`, unless the previous command wrote the same value.

        The value is rounded down. `reads` must include `name`. Return the readings by name; they show the effect of the
        previous command. ReadBackError when the register does not hold the value of the previous command. No retry and
        no quarantine begins that a silent device would prolong beyond `within_s` from now.
        """
        with self._doubt, self._registers.within(within_s):
            self._prove_model()
            write = self._registers.encode(name, value, down)
            self._prove_identity()
            spans = self._registers.plans.read(tuple(reads))
            words = [self._registers.span_words(span, proved=proved) for span in spans]
            before = self._commanded.pop(name, None)
            if before is not None:
                self._registers.confirm(before, words_of_register(spans, words, name))
            if before is None or before.words != write.words:
                self._keep_order(name)
                self._registers.send(write, self._proved_on)
            self._commanded[name] = write
            return decode(spans, words, reads)

    def forget_command(self, name: str) -> None:
        """Forget the previous command to the register `name`: the next `command` writes its value in any case."""
        self._commanded.pop(name, None)

    def send_safe_state(self) -> None:
        """Send the known safe state without waiting for replies if the device does not answer any more.

        The device does not answer if the last exchange and one proof of the identity got no right reply; the proof is
        tried now, unless it has failed already. Nothing is sent on a connection on which no proof has succeeded.
        """
        if not (self._is_proved and (self._doubt.has_failed or self._has_switch)):
            return
        if not self._doubt.is_unanswered:
            with self._registers.within(2.0 * self._registers.attempt_s), suppress(TransportError, ProtocolError):
                self.check_identity()
        if self._is_proved and self._doubt.is_unanswered:
            self._commanded.clear()
            for write in self._safe_writes.values():
                self._registers.send_unconfirmed(write)

    def enter_safe_state(self) -> None:
        """Write the profile's safe state and confirm it by read-back; see `retry_all`.

        A line can lose all replies and still deliver the requests: `send_safe_state` goes first, and a failed write is
        sent again, without waiting.
        """
        with suppress(Exception):  # whatever the error is, the steps follow
            self.send_safe_state()
        steps = [partial(self._make_safe, step.register_, step.value) for step in self.profile.safe_state]
        retry_all([*steps, self._confirm_identity], self.client.clock)

    def _make_safe(self, name: str, value: float) -> None:
        try:
            with self._doubt:
                self._prove_model()
                self._safe_writes[name] = write = self._registers.encode(name, value)
                self._write(write)
        except (TransportError, ProtocolError):
            if self._is_proved and name in self._safe_writes:
                self._registers.send_unconfirmed(self._safe_writes[name])
            raise

    def _confirm_identity(self) -> None:
        """Check the identity if registers can prove it, because another device may have answered the read-backs."""
        if self._type_if_checked is TypeCheck.PROVED or self.identity:
            self.check_identity()

    def _write(self, write: RegisterWrite) -> None:
        """Write the registers that `write_order` demands first, then carry out `write` and read it back."""
        name = write.name
        self._prove_identity()
        self._keep_order(name)
        if write.register.nonvolatile and self._registers.words(name, proved=True) == write.words:
            return  # each write wears the memory of the device
        self._store(write)
        self._written.add(name)
        if name in self._check.model_registers:
            self._proved_on = None

    def _store(self, write: RegisterWrite) -> None:
        """Send the write, and read the register back with `proved=True` if it can be read."""
        self._commanded.pop(write.name, None)
        self._registers.send(write, self._proved_on)
        if write.register.access == "rw":
            self._registers.confirm(write, self._registers.words(write.name, proved=True))

    def _keep_order(self, name: str) -> None:
        """Write the registers that `write_order` demands before a write to `name`, unless they hold the values."""
        for write in self._registers.writes_before(name, self._written):
            if self._registers.words(write.name, proved=True) != write.words:
                self._store(write)

    def _prove_model(self) -> None:
        """Check the identity if the registers depend on the model and the model is not certain at this moment."""
        if self._check.model_registers and (self._has_switch or self._must_be_proved):
            self.check_identity()

    def _prove_identity(self) -> None:
        if self._must_be_proved:
            self.check_identity()

    @property
    def _must_be_proved(self) -> bool:
        return self._doubt.is_raised or not self._is_proved

    @property
    def _is_proved(self) -> bool:
        return self._proved_on == self.client.connection
