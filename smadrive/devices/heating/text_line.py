"""A client that sends a line of text and receives one, for boards without Modbus whose replies have no checksum.

Such a reply proves neither that it answers this command nor that it is undamaged. So a line is accepted only if

1. it has the form of the command's reply, arrived whole before the deadline, and nothing arrived with it;
2. no earlier reply was on its way when the command was sent.

After any failure, and at the beginning, late replies may be on their way. So the greeting is sent before the next
command: the board must return the same banner (its name and firmware) as before, then repeat a token that differs from
the last tokens. All lines before the repeated token are dropped. A board answers in order, so no older line can follow
the token. The banner alone proves nothing, because it may answer an earlier greeting. Greeting and token take two
exchanges, without a pause, because the next command may have to switch a heater off at once.

A damaged reply can still have the right form. The caller must detect it: the caller checks that the board repeats the
value of a command, and reads a measured value twice.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import count
from re import Pattern
from typing import NamedTuple

from smadrive.errors import DeadlineError, IdentityError, ProtocolError, TransportError
from smadrive.modbus.bus import NEVER_SILENT_S, Direction, GuardedTrace, Trace
from smadrive.modbus.transports.transport import Transport

LONGEST = 64
"""Greatest number of characters in a line, including its end."""
END = b"\r\n"
GREETINGS = 3
"""The command fails after this number of greetings without a right answer."""


class Exchange(NamedTuple):
    """A command, and the pattern that the whole line of its reply must match."""

    command: str
    form: Pattern[str]


class TextLine:
    """The only client of a text line.

    `greeting` asks for the banner of the board. `token(n)`, n = 0, 1, 2, ..., is a command whose reply differs from the
    replies to the previous tokens. After many tokens the replies may repeat. A token has no effect on the heaters.
    """

    def __init__(
        self,
        transport: Transport,
        timeout_s: float,
        greeting: Exchange,
        token: Callable[[int], Exchange],
        trace: Trace | None = None,
    ) -> None:
        """Nothing is sent yet. `trace(time_s, direction, bytes)` is called for a line sent, received or discarded."""
        self.clock = transport.clock
        self._transport = transport
        self._timeout_s = timeout_s + transport.latency_s
        self._greeting = greeting
        self._tokens = map(token, count())
        self._trace = GuardedTrace(trace)
        self._banner: str | None = None
        self._greeted = False  # on this connection
        self._in_step = False
        self.is_unanswered = False  # True if the last try to greet the board got no right answer
        self._heard = b""

    def greet(self) -> str:
        """Ask the board for its banner and return it; raises the errors of `ask`."""
        return self.ask(*self._greeting)

    def ask(self, command: str, form: Pattern[str]) -> str:
        """Send `command` and return the reply, a whole line of the given `form`.

        DeadlineError or ProtocolError when no such reply arrives; TransportError when the connection is lost;
        IdentityError when another board answers now. `command` is never sent twice.
        """
        if self._transport.lost:
            self._greeted = self._in_step = False
            self._transport.reopen(self.clock.now_s() + self._timeout_s)
        if stray := self._heard + self._transport.discard():
            self._drop(stray)
        if not self._in_step:
            self._get_in_step()
        self._in_step = False  # until the reply is accepted
        self._send(command)
        reply = self._line(self.clock.now_s() + self._timeout_s, command)
        if self._heard or not form.fullmatch(reply):
            answer = reply.encode("ascii", "replace") + self._heard
            raise ProtocolError(
                "discarded, because the reply has another form",
                where=self._where(command),
                value=f"{answer!r}, expected {form.pattern}",
            )
        self._in_step = True
        return reply

    def send_unconfirmed(self, command: str) -> None:
        """Send a command without waiting for its reply. The greeting goes before the next command.

        Nothing is sent if the connection is lost, or if the board has not answered the greeting on this connection: a
        new connection may lead to another device.
        """
        self._in_step = False
        if self._greeted and not self._transport.lost:
            self._send(command)

    def distrust(self) -> None:
        """Require the greeting before the next command, because the content of the last reply was wrong."""
        self._in_step = False

    def _get_in_step(self) -> None:
        """Send greeting and token, up to `GREETINGS` times with silences between. Raise the last error if all fail."""
        for attempt in range(1, GREETINGS + 1):
            try:
                self._check_banner(self._answer_at_last(self._greeting))
                self._answer_at_last(next(self._tokens))
            except (DeadlineError, ProtocolError):
                if attempt == GREETINGS:
                    self.is_unanswered = True
                    raise
                self._await_silence()
            else:
                self._greeted, self.is_unanswered = True, False
                return

    def _answer_at_last(self, exchange: Exchange) -> str:
        """Send a command and return the first line of the right form. Lines before it are dropped."""
        self._send(exchange.command)
        deadline_s = self.clock.now_s() + self._timeout_s
        while not exchange.form.fullmatch(line := self._line(deadline_s, exchange.command)):
            if self.clock.now_s() >= deadline_s:  # foreign lines may arrive without end
                raise DeadlineError(
                    "other lines, but no right reply before the deadline",
                    where=self._where(exchange.command),
                    value=f"last {line!r}",
                    cure="check that no other program uses the board",
                )
        return line

    def _check_banner(self, line: str) -> None:
        """Keep the first banner; IdentityError when a later one differs."""
        self._banner = self._banner or line
        if line != self._banner:
            raise IdentityError(
                "another board answers now",
                where=self._transport.name,
                value=f"'{line}', was '{self._banner}'",
                cure="check the port in the rig file",
            )

    def _await_silence(self) -> None:
        give_up_s = self.clock.now_s() + NEVER_SILENT_S + self._timeout_s
        while data := self._transport.read(self.clock.now_s() + self._timeout_s):
            self._drop(data)
            if self.clock.now_s() > give_up_s:
                raise TransportError(
                    "the line is never silent",
                    where=self._transport.name,
                    cure="check that no other program uses the board",
                )

    def _send(self, command: str) -> None:
        data = command.encode("ascii") + b"\n"
        self._transport.write(data)
        self._trace_line("sent", data)

    def _line(self, deadline_s: float, command: str) -> str:
        """Return the next line without its end. The bytes behind it stay in `_heard`."""
        while END not in self._heard:
            data = self._transport.read(deadline_s)
            if not data:
                count = len(self._heard)
                self._drop(self._heard)
                raise DeadlineError(
                    "the reply was incomplete at the deadline" if count else "no reply before the deadline",
                    where=self._where(command),
                    value=f"{count} characters",
                    cure="check that the board is powered and at this port, and that no other program uses it",
                )
            self._heard += data
            if len(self._heard) > LONGEST:
                self._drop(self._heard)
                raise ProtocolError(
                    "discarded, because the reply is too long",
                    where=self._where(command),
                    limit=f"{LONGEST} characters",
                )
        line, _, self._heard = self._heard.partition(END)
        self._trace_line("received", line + END)
        return line.decode("ascii", "replace")

    def _drop(self, data: bytes) -> None:
        self._in_step = False
        self._heard = b""
        if data:
            self._trace_line("discarded", data)

    def _where(self, command: str) -> str:
        return f"{self._transport.name}: '{command}'"

    def _trace_line(self, direction: Direction, data: bytes) -> None:
        self._trace(self.clock.now_s(), direction, data)
