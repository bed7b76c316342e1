"""The clients of the page process: which one controls, its requests and their answers.

One client controls, the others watch. Control goes to the first client with the token, and to the next one when that
leaves. The loop goes on without a controlling client, and every client can switch off.
"""

from __future__ import annotations

import json
import secrets
from collections.abc import Callable
from typing import Any

from smadrive.tuning.link.channel import PageEnd

MAX_ANSWERS = 50

WATCHES = "this page only watches: another one controls, or it was opened without the token"

Answered = Callable[[str | None], None]
"""Called with the answer to a request: None, or the reason why it is refused."""


class ClientRegistry:
    """The page's end of the channel, shared by its clients; a client is the id of its session."""

    def __init__(self, channel: PageEnd, token: str) -> None:
        self.channel = channel
        self._token = token
        self._clients: set[str] = set()
        self._controlling: str | None = None
        self._number = 0
        self._pending: dict[int, Answered] = {}
        self._version = -1
        self.status: dict[str, Any] = {}
        self._report()  # a restarted page process has no client yet

    def may_control(self, token: str) -> bool:
        """Whether this is the token that allows to control."""
        return secrets.compare_digest(token.encode(), self._token.encode())

    def enter(self, client: str) -> None:
        """Add a client that has opened a page."""
        self._clients.add(client)
        self._report()

    def claim(self, client: str) -> bool:
        """Whether `client` controls; it takes control if no other client has it."""
        if self._controlling is None:
            self._controlling = client
            self._report()
        return self._controlling == client

    def controls(self, client: str) -> bool:
        """Whether `client` controls: every action checks this."""
        return self._controlling == client

    def leave(self, client: str) -> None:
        """Remove a client that has closed its page."""
        self._clients.discard(client)
        if self._controlling == client:
            self._controlling = None
        self._report()

    def ask(self, client: str, act: str, answered: Answered, **values: Any) -> None:
        """Send a request of the controlling client; a request of another client is refused here."""
        if not self.controls(client):
            answered(WATCHES)
            return
        self._number += 1
        self._pending[self._number] = answered
        if not self.channel.send({"number": self._number, "act": act, **values}):
            del self._pending[self._number]
            answered("the control process accepts no request now: try again")

    def _report(self) -> None:
        self.channel.report_pages(len(self._clients), is_controlled=self._controlling is not None)

    def read(self) -> None:
        """Read the new status, and pass the new answers on."""
        news = self.channel.status(self._version)
        if news is not None:
            self._version, self.status = news
        for message in self.channel.received(MAX_ANSWERS):
            answer = json.loads(message)
            answered = self._pending.pop(answer["number"], None)
            if answered is not None:
                answered(answer["refused"])
