"""A device on the bus, spoken to by register names and in engineering units.

Nothing is written before the identity is proved, and no write is believed before it is read back. A connection that
was opened anew may lead to another device (two adapters of a hub change names): who is there must prove to be the one
of before. Where models of a family differ in their registers, nothing is read either before the model is known; and
where a setting decides (a range switch), it is looked at again before every write.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import chain
from typing import NamedTuple

from smadrive.devices.identity import UNKNOWN, Identity, Proof, check_same, check_type, identity_of
from smadrive.devices.plan_cache import Plans, words_of_register
from smadrive.devices.profile.dependent_registers import context_of
from smadrive.devices.profile.function_codes import write_request
from smadrive.devices.profile.profile import Profile
from smadrive.devices.profile.readings import ALONE, Context, RegisterReading
from smadrive.devices.profile.register import Register
from smadrive.devices.profile.schema import WriteOrder
from smadrive.devices.profile.variants import has_switch, matching
from smadrive.devices.read_plan import RegisterSpan, decode
from smadrive.devices.retry import retry_all
from smadrive.errors import (
    ConfigError,
    DeadlineError,
    ExceptionReply,
    ProtocolError,
    ReadBackError,
    TransportError,
)
from smadrive.modbus import requests
from smadrive.modbus.client import ModbusClient
from smadrive.modbus.requests import Request


class _Write(NamedTuple):
    """One register about to be written."""

    name: str
    register: Register
    context: Context
    words: tuple[int, ...]

    def told(self, words: Sequence[int]) -> str:
        """`words` in engineering units."""
        return f"{self.register.codec.decode(words, self.context).value:g} {self.register.unit}"


class Device:
    """One device of type `profile` at `unit_id` (the profile's own if None) behind `client`.

    `read_retries` takes the place of the profile's: 0 for who reads again soon and cannot wait. `identity` is what
    somebody else has found this very device to be; without it, it is the one that is found first.

    `profile` becomes that of the model once the identity is proved.
    """

    def __init__(
        self,
        profile: Profile,
        client: ModbusClient,
        unit_id: int | None = None,
        read_retries: int | None = None,
        identity: Identity = UNKNOWN,
    ) -> None:
        """Nothing is sent yet. ConfigError when no single device can have `unit_id`."""
        lowest, highest = (1, 247) if profile.profile.protocol == "modbus-rtu" else (0, 255)
        if unit_id is not None and not lowest <= unit_id <= highest:
            raise ConfigError(f"unit_id {unit_id} is outside {lowest} to {highest}")
        self.profile = profile
        self.client = client
        self.clock = client.clock
        self.unit_id = profile.unit_id if unit_id is None else unit_id
        self._family = profile
        self._telling = tuple({name: None for variant in profile.variants for name in variant.match})
        self._switched = False
        timing = profile.bus_timing()
        self._timing = timing if read_retries is None else replace(timing, read_retries=read_retries)
        self.identity = identity
        self.proof = Proof.NOT_ASKED
        self._proved_on: int | None = None
        self._written: set[str] = set()
        self._commanded: dict[str, _Write] = {}
        self._safe_writes: dict[str, _Write] = {}
        self._plans = Plans(profile)

    def check_identity(self) -> None:
        """Prove that the device is the one that the profile describes, and find its model; IdentityError if not.

        Once known, it must be the same one. Before that, a silent one gets the time of a start (`boot_ms`).
        """
        connection = self.client.connection
        proofs = self._family.identify
        names = tuple(dict.fromkeys(chain((proof.register_ for proof in proofs), self._telling)))
        names = names or self._family.measured[:1]  # where nothing proves its type, it answers at least
        readings = self._read_patiently(names) if self._proved_on is None else self._read(names, proved=True)
        check_type(proofs, readings, f"unit {self.unit_id} is no '{self.profile.profile.id}'")
        found = identity_of(self._family, readings)
        check_same(self.identity, found, f"unit {self.unit_id}, a '{self.profile.profile.id}'")
        raws = {name: reading.raw for name, reading in readings.items()}
        variant = matching(self._family.variants, raws)
        self._switched = has_switch(self._family.variants, self._family.registers, raws)
        self._become(self._family if variant is None else self._family.as_variant(variant))
        self.identity, self._proved_on = found, connection
        self.proof = Proof.PROVED if self._family.proves_type else Proof.ANSWERED

    def read(self, names: Sequence[str], *, proved: bool = False) -> dict[str, RegisterReading]:
        """The registers `names`, in as few requests as their addresses allow.

        Plain Modbus RTU cannot tell a stale reply from a current one of equal length: a second copy of the reply before
        may be taken for this one. Where a safety decision rests on the readings, ask for `proved` ones: a request of
        another length is answered first (see ModbusClient.execute), which costs one more transaction for each request.
        """
        if self._telling or self.identity:
            self._prove_identity()
        return self._read(tuple(names), proved=proved)

    def write(self, name: str, value: float) -> None:
        """Write one register and read it back (unless it is write-only); ReadBackError when it did not arrive."""
        self._know_the_scales()
        self._write(self._encoded(name, value))

    def exchange(self, writes: Mapping[str, float], reads: Sequence[str]) -> dict[str, RegisterReading]:
        """Write adjacent registers, then read adjacent registers, in one FC23 transaction; never retried."""
        self._know_the_scales()
        target, source = self._plans.exchange(tuple(writes), tuple(reads))
        words = [word for name, _, _, codec in target.parts for word in codec.encode(writes[name], name)]
        request = requests.exchange(target.address, words, source.address, source.count)
        self._prove_identity()
        return decode((source,), (source.words(self._execute(request)),), reads)

    def command(
        self, name: str, value: float, reads: Sequence[str], *, proved: bool = False
    ) -> dict[str, RegisterReading]:
        """Read `reads`, which include `name`, then write `value` to it, unless it holds that already.

        What is read is what came of the command before. ReadBackError when that one does not stand: it did not arrive,
        or somebody else changed it.
        """
        self._know_the_scales()
        write = self._encoded(name, value)
        self._prove_identity()
        spans = self._plans.read(tuple(reads))
        words = [self._span_words(span, proved=proved) for span in spans]
        before = self._commanded.pop(name, None)
        if before is not None:
            self._confirm(before, words_of_register(spans, words, name))
        if before is None or before.words != write.words:
            self._keep_order(name)
            self._send(write)
        self._commanded[name] = write
        return decode(spans, words, reads)

    def enter_safe_state(self) -> None:
        """Write the profile's safe state, confirmed by read-back; see `retry_all`.

        A line may still carry requests although no reply comes back. So a step that is not answered is sent once more,
        whatever is outstanding: a safe state can be written twice, and only a read-back confirms it.
        """
        steps = [partial(self._make_safe, step.register_, step.value) for step in self.profile.safe_state]
        retry_all(steps, self.client.clock)

    def _make_safe(self, name: str, value: float) -> None:
        try:
            self._know_the_scales()
            self._safe_writes[name] = write = self._encoded(name, value)
            self._write(write)
        except (TransportError, ProtocolError):
            if self._is_proved and name in self._safe_writes:
                self.client.send_unconfirmed(self.unit_id, self._request_of(self._safe_writes[name]), self._timing)
            raise

    def _write(self, write: _Write) -> None:
        """Write it and read it back, where and when that is allowed."""
        name = write.name
        self._prove_identity()
        self._keep_order(name)
        if write.register.nonvolatile and self._words(name) == write.words:
            return  # every write wears the memory
        self._store(write)
        self._written.add(name)
        if name in self._telling:
            self._proved_on = None

    def _execute(self, request: Request, *, proved: bool = False) -> bytes:
        """One transaction, or one with a proof; a write goes out only where the identity was proved."""
        connection = self._proved_on if request.writes else None
        return self.client.execute(self.unit_id, request, self._timing, connection, proved=proved)

    def _read(self, names: tuple[str, ...], *, proved: bool = False) -> dict[str, RegisterReading]:
        spans = self._plans.read(names)
        return decode(spans, [self._span_words(span, proved=proved) for span in spans], names)

    def _read_patiently(self, names: tuple[str, ...]) -> dict[str, RegisterReading]:
        give_up_s = self.client.clock.now_s() + self.profile.timing.boot_ms / 1e3
        while True:
            try:
                return self._read(names, proved=True)
            except DeadlineError:
                if self.client.clock.now_s() >= give_up_s:
                    raise

    def _span_words(self, span: RegisterSpan, *, proved: bool = False) -> tuple[int, ...]:
        request = span.read_request(self.profile.timing.function_codes)
        return span.words(self._execute(request, proved=proved))

    def _words(self, name: str, *, proved: bool = False) -> tuple[int, ...]:
        spans = [span for span in self._plans.read((name,)) if any(part.name == name for part in span.parts)]
        return words_of_register(spans, [self._span_words(span, proved=proved) for span in spans], name)

    def _writable(self, name: str) -> Register:
        register = self.profile.register(name)
        if not register.writable:
            raise ConfigError(f"register '{name}' of '{self.profile.profile.id}' cannot be written (access 'r')")
        return register

    def _encoded(self, name: str, value: float) -> _Write:
        register = self._writable(name)
        context = ALONE
        if register.depends_on:
            context = context_of(register, self._read(register.depends_on))
        if context.problem is not None:
            raise ConfigError(f"register '{name}' cannot be written now: {context.problem}")
        return _Write(name, register, context, register.codec.encode(value, name, context))

    def _store(self, write: _Write) -> None:
        """Send the write and read it back, proved."""
        self._commanded.pop(write.name, None)
        self._send(write)
        if write.register.access == "rw":
            self._confirm(write, self._words(write.name, proved=True))

    def _send(self, write: _Write) -> None:
        try:
            self._execute(self._request_of(write))
        except ExceptionReply as refusal:
            raise ExceptionReply(
                f"register '{write.name}' = {write.told(write.words)}: {refusal}", refusal.code
            ) from None

    def _request_of(self, write: _Write) -> Request:
        register = write.register
        return write_request(register.table, register.address, write.words, self.profile.timing.function_codes)

    def _confirm(self, write: _Write, found: tuple[int, ...]) -> None:
        if found != write.words:
            raise ReadBackError(
                f"unit {self.unit_id}, register '{write.name}': wrote {write.told(write.words)}, reads back "
                f"{write.told(found)}: is the device locked or in a fault, or did somebody turn its knob?"
            )

    def _keep_order(self, name: str) -> None:
        """Do what must be done before `name` is written, or refuse when only the caller can."""
        for rule in self.profile.write_order:
            if rule.before not in ("*", name) or rule.write == name:
                continue
            if rule.value is not None:
                self._hold(rule, rule.value)
            elif rule.write not in self._written:
                raise ConfigError(f"register '{name}' must not be written before '{rule.write}': write that first")

    def _hold(self, rule: WriteOrder, value: float) -> None:
        write = self._encoded(rule.write, value)
        if self._words(rule.write) != write.words:
            self._store(write)

    def _know_the_scales(self) -> None:
        if self._telling and (self._switched or not self._is_proved):
            self.check_identity()

    @property
    def _is_proved(self) -> bool:
        return self._proved_on == self.client.connection

    def _prove_identity(self) -> None:
        if not self._is_proved:
            self.check_identity()

    def _become(self, profile: Profile) -> None:
        if profile.registers is not self.profile.registers:
            self.profile = profile
            self._plans = Plans(profile)
