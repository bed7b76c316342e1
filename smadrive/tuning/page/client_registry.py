"""The clients of the page process: the open pages. The registry decides which client controls the session.

It also sends the requests of the controlling client, and passes the answers to it. One client controls the session, the
others only watch. The first client with the token gets control; the token is part of the address that `smadrive tune`
prints. When this client leaves, the next client with the token gets control. The loop continues without a controlling
client, and every client can switch off.
"""

from __future__ import annotations

import json
import secrets
from collections.abc import Callable
from typing import Any

from smadrive.errors import ConfigError
from smadrive.tuning.link.channel import PageEnd

MAX_ANSWERS = 50

WATCHES = "this page only watches: another page controls, or this page was opened without the token"

Answered = Callable[[str | None], None]
"""A function that gets the answer to a request: None if the request was done, else the reason for its refusal."""


class ClientRegistry:
    """The clients of the page process, which share one `PageEnd`. A client is named by the id of its bokeh session."""

    def __init__(self, channel: PageEnd, token: str | None) -> None:
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
        """Return True if `token` permits control. Return False if the registry was created with the token None."""
        return self._token is not None and secrets.compare_digest(token.encode(), self._token.encode())

    def enter(self, client: str) -> None:
        """Add a client that has opened a page."""
        self._clients.add(client)
        self._report()

    def claim(self, client: str) -> bool:
        """Give control to `client`, which has the token, if control is free. Return True if `client` then controls."""
        if self._controlling is None:
            self._controlling = client
            self._report()
        return self._controlling == client

    def controls(self, client: str) -> bool:
        """Return True if `client` controls. This method checks every action of a user, except OFF."""
        return self._controlling == client

    def leave(self, client: str) -> None:
        """Remove a client that has closed its page. If the client had control, control becomes free."""
        self._clients.discard(client)
        if self._controlling == client:
            self._controlling = None
        self._report()

    def ask(self, client: str, act: str, answered: Answered, **values: Any) -> None:
        """Send the request `act` with `values`; refuse it if `client` does not control. `answered` gets the answer."""
        if not self.controls(client):
            answered(WATCHES)
            return
        self._number += 1
        self._pending[self._number] = answered
        if refused := self._refusal({"number": self._number, "act": act, **values}):
            del self._pending[self._number]
            answered(refused)

    def _refusal(self, request: dict[str, Any]) -> str | None:
        """Send a request. Return None, or the reason if it cannot be sent."""
        try:
            return None if self.channel.send(request) else "the driver accepts no request now: try again"
        except ConfigError as error:
            return str(error)

    def _report(self) -> None:
        self.channel.report_pages(len(self._clients), is_controlled=self._controlling is not None)

    def read(self) -> None:
        """Store a new status in `status`, and pass each new answer to the function `answered` of its request."""
        news = self.channel.status(self._version)
        if news is not None:
            self._version, self.status = news
        for message in self.channel.received(MAX_ANSWERS):
            answer = json.loads(message)
            answered = self._pending.pop(answer["number"], None)
            if answered is not None:
                answered(answer["refused"])
