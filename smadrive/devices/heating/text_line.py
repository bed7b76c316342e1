"""A line of text out, a line of text back: for boards without Modbus, whose replies have no checksum.

Such a reply proves neither which command it answers nor that it is undamaged. So a line counts only if

1. it has the form of the command's reply, arrived whole before the deadline, and nothing arrived with it;
2. nothing was on its way before the command went out.

After any failure, and at the beginning, the line is out of step, and the board is greeted before anything else is sent.
It must return its banner, the same as before, then say back a token that it has not received before. Lines in between
are dropped. A board answers in order, so nothing older can follow the token. The banner alone does not prove that,
because it may answer an earlier greeting. A greeting costs two lines, not a pause: a heater may have to be switched
off. A damaged reply can still have the right form. The caller detects it: the board says a command's value back, or is
asked twice.
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
"""Most characters of a line, with its end."""
END = b"\r\n"
GREETINGS = 3
"""Number of greetings that are tried."""


class Exchange(NamedTuple):
    """A command, and the form of its reply."""

    command: str
    form: Pattern[str]


class TextLine:
    """The one client of a line.

    `greeting` asks for the banner of the board. The reply to `token(n)` differs for every n; a token has no effect on
    the heaters.
    """

    def __init__(
        self,
        transport: Transport,
        timeout_s: float,
        greeting: Exchange,
        token: Callable[[int], Exchange],
        trace: Trace | None = None,
    ) -> None:
        """Nothing is sent yet. `trace(time_s, direction, bytes)` sees every line that passes."""
        self.clock = transport.clock
        self._transport = transport
        self._timeout_s = timeout_s + transport.latency_s
        self._greeting = greeting
        self._tokens = map(token, count())
        self._trace = GuardedTrace(trace)
        self._banner: str | None = None
        self._in_step = False
        self._heard = b""

    def greet(self) -> str:
        """The banner, asked for anew; raises the errors of `ask`."""
        return self.ask(*self._greeting)

    def ask(self, command: str, form: Pattern[str]) -> str:
        """The reply to `command`, a whole line of the `form`.

        DeadlineError, ProtocolError when there is no such reply; TransportError when the connection is lost;
        IdentityError when another board answers than before. Nothing is sent twice.
        """
        if self._transport.lost:
            self._in_step = False
            self._transport.reopen(self.clock.now_s() + self._timeout_s)
        if stray := self._heard + self._transport.discard():
            self._drop(stray)
        if not self._in_step:
            self._get_in_step()
        self._in_step = False  # until the reply proves right
        self._send(command)
        reply = self._line(self.clock.now_s() + self._timeout_s, command)
        if self._heard or not form.fullmatch(reply):
            answer = reply.encode("ascii", "replace") + self._heard
            raise ProtocolError(
                "discarded, the reply has another form",
                where=self._where(command),
                value=repr(answer),
                limit=form.pattern,
            )
        self._in_step = True
        return reply

    def send_unconfirmed(self, command: str) -> None:
        """Send a command that must go out although no reply comes; the board is greeted before the next one.

        Nothing is sent through a connection that is lost.
        """
        self._in_step = False
        if not self._transport.lost:
            self._send(command)

    def distrust(self) -> None:
        """Greet the board before the next command, because the content of the last reply was wrong."""
        self._in_step = False

    def _get_in_step(self) -> None:
        """Greet the board, up to `GREETINGS` times with a silence between; DeadlineError when it does not answer."""
        for attempt in range(1, GREETINGS + 1):
            try:
                self._check_banner(self._answer_at_last(self._greeting))
                self._answer_at_last(next(self._tokens))
            except (DeadlineError, ProtocolError):
                if attempt == GREETINGS:
                    raise
                self._await_silence()
            else:
                return

    def _answer_at_last(self, exchange: Exchange) -> str:
        """The first line of the right form; lines before it are dropped."""
        self._send(exchange.command)
        deadline_s = self.clock.now_s() + self._timeout_s
        while not exchange.form.fullmatch(line := self._line(deadline_s, exchange.command)):
            pass
        return line

    def _check_banner(self, line: str) -> None:
        """Keep the first banner; IdentityError when a later one differs."""
        self._banner = self._banner or line
        if line != self._banner:
            raise IdentityError(
                "another board answers than before",
                where=self._transport.name,
                value=f"'{line}', was '{self._banner}'",
            )

    def _await_silence(self) -> None:
        give_up_s = self.clock.now_s() + NEVER_SILENT_S + self._timeout_s
        while data := self._transport.read(self.clock.now_s() + self._timeout_s):
            self._drop(data)
            if self.clock.now_s() > give_up_s:
                raise TransportError(
                    "the line is never silent",
                    where=self._transport.name,
                    cure="check that no other program talks to the board",
                )

    def _send(self, command: str) -> None:
        data = command.encode("ascii") + b"\n"
        self._transport.write(data)
        self._trace_line("sent", data)

    def _line(self, deadline_s: float, command: str) -> str:
        """The next line, without its end; bytes behind it stay in `_heard`."""
        while END not in self._heard:
            data = self._transport.read(deadline_s)
            if not data:
                count = len(self._heard)
                self._drop(self._heard)
                raise DeadlineError(
                    "the reply was not complete before the deadline" if count else "no reply before the deadline",
                    where=self._where(command),
                    value=f"{count} characters",
                    cure="check that the board is powered and at this port, and that no other program talks to it",
                )
            self._heard += data
            if len(self._heard) > LONGEST:
                self._drop(self._heard)
                raise ProtocolError(
                    "discarded, the reply is too long", where=self._where(command), limit=f"{LONGEST} characters"
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
