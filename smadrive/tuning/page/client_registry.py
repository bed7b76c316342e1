"""Who may act, and what became of what was asked. One for all documents of the page process.

One client controls, the others watch. Control goes to the first that brings the token, and on to the next when it
leaves. Losing it stops nothing: the loop goes on, and switching off is open to everybody.
"""

from __future__ import annotations

import json
import secrets
from collections.abc import Callable
from typing import Any

from smadrive.tuning.link.channel import PageEnd

MOST_ANSWERS = 50

WATCHES = "this page only watches: another one controls, or it was opened without the token"

Answered = Callable[[str | None], None]
"""Told when a request was answered: None, or why it was refused."""


class ClientRegistry:
    """The page's end of the channel, shared by its clients, who are known by the id of their session."""

    def __init__(self, channel: PageEnd, token: str) -> None:
        self.channel = channel
        self._token = token
        self._clients: set[str] = set()
        self._controlling: str | None = None
        self._number = 0
        self._asked: dict[int, Answered] = {}
        self._version = -1
        self.status: dict[str, Any] = {}
        self._tell()  # a page process that was started anew has no client yet

    def may_control(self, token: str) -> bool:
        """Whether this is the token."""
        return secrets.compare_digest(token.encode(), self._token.encode())

    def enter(self, client: str) -> None:
        """`client` has opened a page."""
        self._clients.add(client)
        self._tell()

    def claim(self, client: str) -> bool:
        """Whether `client` controls; it does from now on if nobody else does."""
        if self._controlling is None:
            self._controlling = client
            self._tell()
        return self._controlling == client

    def controls(self, client: str) -> bool:
        """Whether `client` controls: the gate that every act passes."""
        return self._controlling == client

    def leave(self, client: str) -> None:
        """`client` has closed it."""
        self._clients.discard(client)
        if self._controlling == client:
            self._controlling = None
        self._tell()

    def ask(self, client: str, act: str, answered: Answered, **values: Any) -> None:
        """Send a request of the controlling client; that of another is refused here."""
        if not self.controls(client):
            answered(WATCHES)
            return
        self._number += 1
        self._asked[self._number] = answered
        if not self.channel.send({"number": self._number, "act": act, **values}):
            del self._asked[self._number]
            answered("the control process does not take requests now: try again")

    def _tell(self) -> None:
        self.channel.tell_pages(len(self._clients), is_controlled=self._controlling is not None)

    def read(self) -> None:
        """Take what the control process has published and answered since."""
        news = self.channel.status(self._version)
        if news is not None:
            self._version, self.status = news
        for message in self.channel.received(MOST_ANSWERS):
            answer = json.loads(message)
            answered = self._asked.pop(answer["number"], None)
            if answered is not None:
                answered(answer["refused"])
