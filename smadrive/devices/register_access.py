"""The registers of one unit: read by name, encoded and sent as writes, compared with their read-back.

The identity of the device is not checked here: `Device` proves it first, and binds every write to the connection on
which it was proved.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from smadrive.devices.profile.dependent_registers import context_of
from smadrive.devices.profile.function_codes import write_request
from smadrive.devices.profile.profile import Profile
from smadrive.devices.profile.readings import ALONE, Context, RegisterReading
from smadrive.devices.profile.register import Register
from smadrive.devices.read_plan import RegisterSpan, RequestPlans, decode, words_of_register
from smadrive.errors import ConfigError, ExceptionReply, ReadBackError
from smadrive.modbus.bus import BusTiming
from smadrive.modbus.client import ModbusClient
from smadrive.modbus.requests import Request


class RegisterWrite(NamedTuple):
    """A write of one register: the words, and the context that gives them their meaning."""

    name: str
    register: Register
    context: Context
    words: tuple[int, ...]

    def text(self, words: Sequence[int]) -> str:
        """`words` as a value of this register in engineering units."""
        return f"{self.register.codec.decode(words, self.context).value:g} {self.register.unit}"


class RegisterAccess:
    """The registers of `profile` at `unit_id` behind `client`; raises the errors of the client."""

    def __init__(self, profile: Profile, client: ModbusClient, unit_id: int, timing: BusTiming) -> None:
        self.profile = profile
        self.plans = RequestPlans(profile)
        self._client = client
        self._unit_id = unit_id
        self._timing = timing

    def use(self, profile: Profile) -> None:
        """Take the registers of another profile, that of the model."""
        if profile.registers is not self.profile.registers:
            self.profile = profile
            self.plans = RequestPlans(profile)

    def execute(self, request: Request, connection: int | None = None, *, proved: bool = False) -> bytes:
        """The payload of the reply; `connection`, `proved`: see ModbusClient.execute."""
        return self._client.execute(self._unit_id, request, self._timing, connection, proved=proved)

    def read(self, names: tuple[str, ...], *, proved: bool = False) -> dict[str, RegisterReading]:
        """The readings of the registers `names`."""
        spans = self.plans.read(names)
        return decode(spans, [self.span_words(span, proved=proved) for span in spans], names)

    def span_words(self, span: RegisterSpan, *, proved: bool = False) -> tuple[int, ...]:
        """The words of a span, read from the device."""
        request = span.read_request(self.profile.timing.function_codes)
        return span.words(self.execute(request, proved=proved))

    def words(self, name: str, *, proved: bool = False) -> tuple[int, ...]:
        """The words of one register, read from the device."""
        spans = [span for span in self.plans.read((name,)) if any(part.name == name for part in span.parts)]
        return words_of_register(spans, [self.span_words(span, proved=proved) for span in spans], name)

    def encode(self, name: str, value: float) -> RegisterWrite:
        """The write of `value`; ConfigError when it cannot be written. Reads the registers on which `name` depends."""
        register = self.profile.register(name)
        if not register.writable:
            raise ConfigError("cannot be written (access 'r')", where=f"register '{name}' of '{self._id}'")
        context = ALONE
        if register.depends_on:
            context = context_of(register, self.read(register.depends_on))
        if context.problem is not None:
            raise ConfigError("cannot be written now", where=f"register '{name}'", value=context.problem)
        return RegisterWrite(name, register, context, register.codec.encode(value, name, context))

    def send(self, write: RegisterWrite, connection: int | None) -> None:
        """Send the write on this connection; an ExceptionReply names register and value."""
        try:
            self.execute(self._request(write), connection)
        except ExceptionReply as error:
            error.where += f", register '{write.name}' = {write.text(write.words)}"
            raise

    def send_unconfirmed(self, write: RegisterWrite) -> None:
        """Send the write once, without waiting for its reply."""
        self._client.send_unconfirmed(self._unit_id, self._request(write), self._timing)

    def confirm(self, write: RegisterWrite, found: tuple[int, ...]) -> None:
        """ReadBackError when the words read back differ from those written."""
        if found != write.words:
            raise ReadBackError(
                "reads back another value than was written",
                where=f"unit {self._unit_id}, register '{write.name}'",
                value=f"{write.text(found)}, wrote {write.text(write.words)}",
                cure="check whether the device is locked or in a fault, and whether its knob was turned",
            )

    @property
    def _id(self) -> str:
        return self.profile.profile.id

    def _request(self, write: RegisterWrite) -> Request:
        register = write.register
        return write_request(register.table, register.address, write.words, self.profile.timing.function_codes)
