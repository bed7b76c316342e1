"""The front process: it owns the port of the tuning page, answers OFF, and passes page loads on.

The page process needs about a second to build a page, and any program can request pages. OFF must never wait for the
building of a page. So the front process builds nothing. It counts each OFF in shared memory, where the loop sees the
OFF at the next tick, and limits the number of page loads that it passes to the page process.

    POST /off   is counted here
    /state      is a websocket that reports how the run ended, and which page process answers
    /static     gives the scripts of bokeh
    /, /ws      are passed on to the page process; 503 while MAX_BUILDS pages are being built or MAX_PAGES are open

The driver owns the listening socket. Requests that arrive while the front process is restarted wait in this socket.
"""

from __future__ import annotations

import asyncio
import json
import logging
import socket
import sys
from collections.abc import Awaitable
from contextlib import suppress
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from tornado.httpserver import HTTPServer
from tornado.ioloop import PeriodicCallback
from tornado.iostream import IOStream
from tornado.web import Application
from tornado.websocket import WebSocketClosedError, WebSocketHandler

from smadrive.files.extras import check_extra
from smadrive.stream.child import report_ready, run
from smadrive.tuning.front.gate import GatedHandler, StaticHandler, UnknownPath
from smadrive.tuning.front.relay import CHUNK_BYTES, PageHandler, PageSocketHandler, Relay
from smadrive.tuning.link.address import page_hosts
from smadrive.tuning.link.channel import PageEnd

MAX_CONNECTIONS = 512
"""Largest number of connections. A further connection closes the oldest one, so idle connections cannot block OFF."""

IDLE_S = 30.0
"""A connection without a request is closed after this time."""

MAX_HEAD_BYTES = 1 << 14
MAX_BODY_BYTES = 1 << 10
"""No request needs a body. A body that is longer than this is refused before it is read: parsing would delay OFF."""

BODY_WITHIN_S = 2.0
"""A connection is closed if the body of its request has not arrived after this time."""

LIMITS = {
    "idle_connection_timeout": IDLE_S,
    "body_timeout": BODY_WITHIN_S,
    "max_header_size": MAX_HEAD_BYTES,
    "max_body_size": MAX_BODY_BYTES,
    "max_buffer_size": 2 * CHUNK_BYTES,  # the chunk that the relay reads, and a second one behind it
}

STALLED_S = 5.0
"""A page process whose last heartbeat is older than this counts as dead. Building a page delays a heartbeat by 1 s."""

REPORT_MS = 100
FAREWELL_S = 0.5
"""Before it ends, the front process waits at most this time until the last state has been sent to the pages."""


class OffHandler(GatedHandler):
    """POST /off: the loop switches the heater off at its next tick."""

    def check_xsrf_cookie(self) -> None:
        """Require no cookie: the user can switch off without loading a page. The check of `GatedHandler` is enough."""

    def post(self) -> None:
        """Count an OFF in the shared memory."""
        channel: PageEnd = self.settings["channel"]
        channel.request_off()
        self.write({"off": "requested"})


class States:
    """Reports the state to all pages, by one websocket for each page. The state is a JSON object:

    page    process id of the page process; null if none answers
    end     how the run has ended, see `report`; null while it runs
    """

    def __init__(self, channel: PageEnd) -> None:
        self._channel = channel
        self._sockets: set[StateHandler] = set()
        self._text = ""

    def enter(self, page: StateHandler) -> None:
        """Report the state, and every later change of it, to a page that has just connected."""
        self._sockets.add(page)
        page.write_message(self._text)

    def leave(self, page: StateHandler) -> None:
        """Report nothing more to this page."""
        self._sockets.discard(page)

    def report(self, end: str | None = None) -> list[Awaitable[None]]:
        """Send the state to all pages if it has changed. Return an awaitable for each message that is being sent.

        `end` is the word for how the run has ended, such as "off", or None while it runs.
        """
        text = json.dumps({"page": self._channel.page_server(STALLED_S), "end": end})
        if text == self._text:
            return []
        self._text = text
        return [_sent(page, text) for page in self._sockets]

    async def report_changes(self) -> None:
        """Send a heartbeat to the driver. If the state has changed, send the state to all pages."""
        self._channel.beat_front()
        await asyncio.gather(*self.report())

    async def report_end(self) -> None:
        """Report the published end of the run, or "unknown" if the driver died before it published the end."""
        published = self._channel.status(-1)
        end = published[1]["end"] if published else None
        with suppress(TimeoutError):
            await asyncio.wait_for(asyncio.gather(*self.report(end or "unknown")), FAREWELL_S)


async def _sent(page: StateHandler, text: str) -> None:
    with suppress(WebSocketClosedError):
        await page.write_message(text)


class StateHandler(GatedHandler, WebSocketHandler):
    """GET /state: the websocket that reports the state to a page while the page is open."""

    def open(self) -> None:
        """Report the state to this page."""
        states: States = self.settings["states"]
        states.enter(self)

    def on_message(self, message: str | bytes) -> None:
        """Ignore messages of the page."""

    def on_close(self) -> None:
        """Stop reporting to this page."""
        states: States = self.settings["states"]
        states.leave(self)


class FrontServer(HTTPServer):
    """An HTTP server that always accepts a further connection, and limits the size of every request."""

    def initialize(self, *args: Any, **kwargs: Any) -> None:
        """Initialize the server with `LIMITS`."""
        super().initialize(*args, **{**LIMITS, **kwargs})
        self._streams: list[IOStream] = []

    def handle_stream(self, stream: IOStream, address: tuple[Any, ...]) -> None:
        """Serve a connection. If there are too many, close the oldest one."""
        self._streams = [open_one for open_one in self._streams if not open_one.closed()]
        if len(self._streams) >= MAX_CONNECTIONS:
            self._streams.pop(0).close()
        self._streams.append(stream)
        super().handle_stream(stream, address)


async def serve(parameters: dict[str, Any]) -> None:
    """Serve the port of the page until standard input ends."""
    channel = PageEnd(parameters["memory_fd"], socket.socket(fileno=parameters["socket_fd"]))
    states = States(channel)
    application = Application(
        [
            (r"/off", OffHandler),
            (r"/state", StateHandler),
            (r"/static/(.*)", StaticHandler, {"path": bokeh_static()}),
            (r"/", PageHandler),
            (r"/ws", PageSocketHandler),
        ],
        default_handler_class=UnknownPath,
        hosts=page_hosts(parameters["port"]),
        channel=channel,
        states=states,
        relay=Relay(parameters["path"], channel),
        websocket_max_message_size=MAX_BODY_BYTES,
    )
    states.report()
    server = FrontServer(application)
    listener = socket.socket(fileno=parameters["listener_fd"])
    listener.setblocking(False)
    server.add_socket(listener)
    reporting = PeriodicCallback(states.report_changes, REPORT_MS)
    reporting.start()
    channel.beat_front()
    report_ready()
    await _end_of_input()
    reporting.stop()
    server.stop()
    await states.report_end()


def bokeh_static() -> Path:
    """Return the folder of bokeh's scripts. ConfigError when the extra `tune` is not installed.

    bokeh itself is not imported, because the import would take half a second.
    """
    check_extra("tune", "the page")
    package = find_spec("bokeh")
    assert package is not None
    assert package.origin is not None
    return Path(package.origin).parent / "server" / "static"


async def _end_of_input() -> None:
    ended = asyncio.Event()
    asyncio.get_running_loop().add_reader(sys.stdin.fileno(), ended.set)
    await ended.wait()


if __name__ == "__main__":
    logging.getLogger("tornado.access").setLevel(logging.CRITICAL)  # refused requests are not shown in the terminal
    run(lambda parameters: asyncio.run(serve(parameters)))
