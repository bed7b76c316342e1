"""A line of text out, a line of text back: for boards that speak no Modbus, and whose replies have no checksum.

Such a reply says neither to what command it is the answer nor that it is undamaged. So a line counts only if

1. it has the form that the command's reply must have, came whole before the deadline, and nothing came with it;
2. nothing was on its way before the command went out.

After any failure, and at the beginning, the line is out of step, and the board is greeted before anything else is sent:
it must give its banner, the same as ever, then say back a token that it never heard before. What comes in between is
dropped. A board answers in order, so behind the token nothing older can come; the banner alone does not tell that,
because it may be that of an earlier greeting. All this costs two lines, not a pause: a heater may have to be switched
off. What a damaged reply may still look like is for the caller to see through: by
saying a command's value back, or by asking twice.
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
"""Characters of a line, its end included."""
END = b"\r\n"
GREETINGS = 3
"""So many unanswered greetings, and the line stays out of step."""


class Exchange(NamedTuple):
    """A command, and the form of its reply."""

    command: str
    form: Pattern[str]


class TextLine:
    """The one client of a line.

    `greeting` asks the board who it is; `token(n)` has it say something back that is another for every n, and does
    nothing else that matters.
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
        """The banner, asked for anew; raises what `ask` raises."""
        return self.ask(*self._greeting)

    def ask(self, command: str, form: Pattern[str]) -> str:
        """The reply to `command`, all of which has the `form`.

        DeadlineError, ProtocolError when it is none; TransportError when the connection is lost; IdentityError when
        another board answers than before. Nothing is sent twice.
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
            said = reply.encode("ascii", "replace") + self._heard
            raise ProtocolError(
                f"{self._transport.name}: '{command}' is answered by {said!r}, not by one line of the form "
                f"{form.pattern}: discarded"
            )
        self._in_step = True
        return reply

    def send_unconfirmed(self, command: str) -> None:
        """Send a command that must go out although nothing is answered; the board is greeted before the next one.

        Nothing is sent through a connection that is lost.
        """
        self._in_step = False
        if not self._transport.lost:
            self._send(command)

    def distrust(self) -> None:
        """Greet the board before the next command: for callers that find a reply wrong by its content."""
        self._in_step = False

    def _get_in_step(self) -> None:
        """Greet, after a silence where that was not answered; DeadlineError when it never is."""
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
        """The first line of the right form, those before it dropped."""
        self._send(exchange.command)
        deadline_s = self.clock.now_s() + self._timeout_s
        while not exchange.form.fullmatch(line := self._line(deadline_s, exchange.command)):
            pass
        return line

    def _check_banner(self, line: str) -> None:
        """The first one that there is becomes the banner of this line."""
        self._banner = self._banner or line
        if line != self._banner:
            raise IdentityError(f"{self._transport.name}: '{line}' answers where '{self._banner}' did: another board?")

    def _await_silence(self) -> None:
        give_up_s = self.clock.now_s() + NEVER_SILENT_S + self._timeout_s
        while data := self._transport.read(self.clock.now_s() + self._timeout_s):
            self._drop(data)
            if self.clock.now_s() > give_up_s:
                raise TransportError(f"{self._transport.name}: never silent: does another program talk to the board?")

    def _send(self, command: str) -> None:
        data = command.encode("ascii") + b"\n"
        self._transport.write(data)
        self._tell("sent", data)

    def _line(self, deadline_s: float, command: str) -> str:
        """The next line, without its end; what comes with it stays in `_heard`."""
        while END not in self._heard:
            data = self._transport.read(deadline_s)
            if not data:
                told = f"{len(self._heard)} characters" if self._heard else "nothing"
                self._drop(self._heard)
                raise DeadlineError(
                    f"{self._transport.name}: '{command}': {told} of the reply before the deadline: is the board "
                    "powered, is it this port, and is no other program talking to it?"
                )
            self._heard += data
            if len(self._heard) > LONGEST:
                self._drop(self._heard)
                raise ProtocolError(f"{self._transport.name}: '{command}': more than {LONGEST} characters: discarded")
        line, _, self._heard = self._heard.partition(END)
        self._tell("received", line + END)
        return line.decode("ascii", "replace")

    def _drop(self, data: bytes) -> None:
        self._in_step = False
        self._heard = b""
        if data:
            self._tell("discarded", data)

    def _tell(self, direction: Direction, data: bytes) -> None:
        self._trace(self.clock.now_s(), direction, data)
