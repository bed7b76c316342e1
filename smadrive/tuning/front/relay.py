"""The relay between browsers and the page process. It passes on page loads and the websockets of open pages, as bytes.

The relay composes a new HTTP head for each request, from the path of the request and the few header fields that bokeh
needs. Nothing else of the request reaches the page process. A page load counts towards MAX_BUILDS until the page is
built. This also holds if the browser has closed the connection: the page process still builds the page.
"""

from __future__ import annotations

import asyncio
import socket
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from http import HTTPStatus

from tornado.httputil import HTTPServerRequest
from tornado.iostream import IOStream, StreamClosedError
from tornado.web import HTTPError

from smadrive.tuning.front.gate import GatedHandler
from smadrive.tuning.link.channel import PageEnd

MAX_BUILDS = 2
"""Largest number of pages that are built at the same time."""

MAX_PAGES = 8
"""Largest number of pages that are open at the same time."""

CHUNK_BYTES = 1 << 16
WEBSOCKET_FIELDS = (
    "Origin",
    "Upgrade",
    "Sec-WebSocket-Key",
    "Sec-WebSocket-Version",
    "Sec-WebSocket-Protocol",
    "Sec-WebSocket-Extensions",
)
BUSY = (
    '<!DOCTYPE html><meta charset="utf-8"><meta http-equiv="refresh" content="2"><title>smadrive</title>'
    "<p>The tuning page is busy or being started. This page tries again by itself.</p>"
    "<p>To switch the heater off now: <code>curl -X POST http://{host}/off</code></p>"
)


class LimitedActions:
    """Counts the actions that run now. The caller begins no action while `are_taken` is True."""

    def __init__(self, limit: int) -> None:
        self.limit = limit
        self.taken = 0

    @property
    def are_taken(self) -> bool:
        """True if `limit` actions, or more, run now."""
        return self.taken >= self.limit

    @contextmanager
    def one(self) -> Iterator[None]:
        """Count one more action until the `with` block ends. This method does not check `limit`."""
        self.taken += 1
        try:
            yield
        finally:
            self.taken -= 1


class Relay:
    """Sends requests to the page process. The page process listens on the Unix socket at `path`."""

    def __init__(self, path: str, channel: PageEnd) -> None:
        self._path = path
        self._channel = channel
        self.builds = LimitedActions(MAX_BUILDS)
        self.sockets = LimitedActions(MAX_PAGES)

    @property
    def is_busy(self) -> bool:
        """True if no further page may be built now."""
        return self.builds.are_taken or self._channel.pages_open >= MAX_PAGES

    async def page(self, request: HTTPServerRequest) -> bytes | None:
        """Return the whole reply to a page load. Return None when the page process does not reply."""
        with self.builds.one(), suppress(StreamClosedError):
            server = await self.sent(request, {"Connection": "close"})
            return await server.read_until_close() or None
        return None

    async def sent(self, request: HTTPServerRequest, fields: Mapping[str, str]) -> IOStream:
        """Send the request with the header `fields` to the page process. Return the connection for the reply.

        StreamClosedError when no page process listens.
        """
        server = IOStream(socket.socket(socket.AF_UNIX))
        await server.connect(self._path)
        fields = {"Host": request.host, **fields}
        lines = [f"GET {request.uri} HTTP/1.1", *(f"{name}: {value}" for name, value in fields.items()), "", ""]
        await server.write("\r\n".join(lines).encode("latin-1"))
        return server


class PageHandler(GatedHandler):
    """GET /: a page, built by the page process; 503 if `Relay.is_busy`, or if the page process does not reply."""

    async def get(self) -> None:
        """Send the request to the page process, and the reply to the browser. Without a reply, send 503."""
        relay: Relay = self.settings["relay"]
        page = None if relay.is_busy else await relay.page(self.request)
        if page is None:
            self.set_status(HTTPStatus.SERVICE_UNAVAILABLE)
            self.finish(BUSY.format(host=self.request.host))
            return
        client = self.detach()
        with suppress(StreamClosedError):
            await client.write(page)
        client.close()


class PageSocketHandler(GatedHandler):
    """GET /ws: the websocket of an open page."""

    async def get(self) -> None:
        """Pass data in both directions until the browser or the page process closes the connection."""
        relay: Relay = self.settings["relay"]
        headers = self.request.headers
        if headers.get("Upgrade", "").lower() != "websocket":
            raise HTTPError(HTTPStatus.BAD_REQUEST)
        if relay.sockets.are_taken:
            raise HTTPError(HTTPStatus.SERVICE_UNAVAILABLE)
        fields = {"Connection": "Upgrade", **{name: headers[name] for name in WEBSOCKET_FIELDS if name in headers}}
        with relay.sockets.one():
            try:
                server = await relay.sent(self.request, fields)
            except StreamClosedError:
                raise HTTPError(HTTPStatus.SERVICE_UNAVAILABLE) from None
            await _join(self.detach(), server)


async def _join(client: IOStream, server: IOStream) -> None:
    pumps = [asyncio.create_task(_pump(*pair)) for pair in ((client, server), (server, client))]
    await asyncio.wait(pumps, return_when=asyncio.FIRST_COMPLETED)
    client.close()
    server.close()
    await asyncio.gather(*pumps)


async def _pump(source: IOStream, target: IOStream) -> None:
    with suppress(StreamClosedError):
        while True:
            await target.write(await source.read_bytes(CHUNK_BYTES, partial=True))
