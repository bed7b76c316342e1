"""The registers of one unit: reads by name, writes, and the comparison of read-backs.

This module does not check the identity of the device. `Device` proves the identity first, and binds every write to the
connection on which it was proved.
"""

from __future__ import annotations

from collections.abc import Container, Iterator, Sequence
from contextlib import contextmanager
from math import inf
from typing import NamedTuple

from smadrive.devices.profile.codec import Rounding
from smadrive.devices.profile.dependent_registers import context_of
from smadrive.devices.profile.function_codes import write_request
from smadrive.devices.profile.profile import Profile
from smadrive.devices.profile.readings import ALONE, Context, RegisterReading
from smadrive.devices.profile.register import Register
from smadrive.devices.read_plan import RegisterSpan, RequestPlans, decode, words_of_register
from smadrive.errors import ConfigError, DeadlineError, ExceptionReply, ReadBackError
from smadrive.modbus.bus import BusTiming
from smadrive.modbus.client import ModbusClient
from smadrive.modbus.requests import Request


class RegisterWrite(NamedTuple):
    """A write of one register: the words, and the context that determines their meaning."""

    name: str
    register: Register
    context: Context
    words: tuple[int, ...]

    def text(self, words: Sequence[int]) -> str:
        """Return `words` as text: the value that they mean in this register, with its unit."""
        return f"{self.register.codec.decode(words, self.context).value:g} {self.register.unit}"


class RegisterAccess:
    """The registers of `profile` at `unit_id` behind `client`. Methods raise the errors of the client."""

    def __init__(self, profile: Profile, client: ModbusClient, unit_id: int, timing: BusTiming) -> None:
        self.profile = profile
        self.plans = RequestPlans(profile)
        self._client = client
        self._unit_id = unit_id
        self._timing = timing
        self._retry_until_s = inf

    @property
    def attempt_s(self) -> float:
        """The time of a request that the device does not answer, s."""
        return self._client.attempt_s(self._timing)

    def use(self, profile: Profile) -> None:
        """Use the registers of `profile`, the profile of the proved model, from now on."""
        if profile.registers is not self.profile.registers:
            self.profile = profile
            self.plans = RequestPlans(profile)

    @contextmanager
    def within(self, time_s: float) -> Iterator[None]:
        """Within the block, no retry and no quarantine begins that a silent device would outlast `time_s`.

        A first request on a silent bus begins in any case.
        """
        before_s = self._retry_until_s
        self._retry_until_s = min(before_s, self._client.clock.now_s() + time_s)
        try:
            yield
        finally:
            self._retry_until_s = before_s

    def execute(self, request: Request, connection: int | None = None, *, proved: bool = False) -> bytes:
        """Send the request and return the payload of the reply; see ModbusClient.execute for the arguments."""
        retry_until_s = self._retry_until_s
        return self._client.execute(
            self._unit_id, request, self._timing, connection, proved=proved, retry_until_s=retry_until_s
        )

    def read(self, names: tuple[str, ...], *, proved: bool = False) -> dict[str, RegisterReading]:
        """Read the registers `names` and return their readings."""
        spans = self.plans.read(names)
        return decode(spans, [self.span_words(span, proved=proved) for span in spans], names)

    def read_patiently(self, names: tuple[str, ...]) -> dict[str, RegisterReading]:
        """Read the registers with `proved=True`; if the device is silent, try again until `patience_s` has passed."""
        give_up_s = self._client.clock.now_s() + self.profile.timing.patience_s
        while True:
            try:
                return self.read(names, proved=True)
            except DeadlineError:
                if self._client.clock.now_s() >= give_up_s:
                    raise

    def span_words(self, span: RegisterSpan, *, proved: bool = False) -> tuple[int, ...]:
        """Read the adjacent registers of a span with one request, and return their words."""
        request = span.read_request(self.profile.timing.function_codes)
        return span.words(self.execute(request, proved=proved))

    def words(self, name: str, *, proved: bool = False) -> tuple[int, ...]:
        """Read one register and return its words."""
        spans = [span for span in self.plans.read((name,)) if any(part.name == name for part in span.parts)]
        return words_of_register(spans, [self.span_words(span, proved=proved) for span in spans], name)

    def encode(self, name: str, value: float, rounding: Rounding = round) -> RegisterWrite:
        """Read the registers on which `name` depends with `proved=True`, and return the write of `value` to `name`.

        `rounding` makes the raw number whole. ConfigError if `value` cannot be written.
        """
        register = self.profile.register(name)
        if not register.writable:
            raise ConfigError("cannot be written", where=f"register '{name}' of '{self._id}'", value="access 'r'")
        context = ALONE
        if register.depends_on:
            context = context_of(register, self.read(register.depends_on, proved=True))
        if context.problem is not None:
            raise ConfigError("cannot be written now", where=f"register '{name}'", value=context.problem)
        return RegisterWrite(name, register, context, register.codec.encode(value, name, context, rounding))

    def writes_before(self, name: str, written: Container[str]) -> Iterator[RegisterWrite]:
        """Yield the writes of fixed values that `write_order` demands before a write to `name`.

        ConfigError if a rule has no value and its register is not among the registers `written` so far.
        """
        for rule in self.profile.write_order:
            if rule.before not in ("*", name) or rule.write == name:
                continue
            if rule.value is not None:
                yield self.encode(rule.write, rule.value)
            elif rule.write not in written:
                raise ConfigError(
                    f"cannot be written before '{rule.write}'",
                    where=f"register '{name}'",
                    cure=f"write '{rule.write}' first",
                )

    def send(self, write: RegisterWrite, connection: int | None) -> None:
        """Send the write on the connection with this number; None allows any. An ExceptionReply names the register."""
        try:
            self.execute(self._request(write), connection)
        except ExceptionReply as error:
            error.where += f", register '{write.name}' = {write.text(write.words)}"
            raise

    def send_unconfirmed(self, write: RegisterWrite) -> None:
        """Send the write once, without waiting for its reply."""
        self._client.send_unconfirmed(self._unit_id, self._request(write), self._timing)

    def confirm(self, write: RegisterWrite, found: tuple[int, ...]) -> None:
        """Raise ReadBackError if the words that were read back differ from the written words."""
        if found != write.words:
            raise ReadBackError(
                "reads back another value than the written one",
                where=f"unit {self._unit_id}, register '{write.name}'",
                value=f"{write.text(found)}, wrote {write.text(write.words)}",
                cure="check that the device is neither locked nor in a fault, and that its knob was not turned",
            )

    @property
    def _id(self) -> str:
        return self.profile.profile.id

    def _request(self, write: RegisterWrite) -> Request:
        register = write.register
        return write_request(register.table, register.address, write.words, self.profile.timing.function_codes)
