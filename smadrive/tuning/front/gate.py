"""The gate of the tuning page: a check that refuses requests from pages of other web sites.

A page of any web site can make the browser send requests to 127.0.0.1, and the name of such a site may resolve to
127.0.0.1. Three headers show where a request comes from, and no script of a page can change these headers:

    Host             the name in the address; a foreign name that resolves to this machine is an attack
    Origin           the page that sends the request; every POST and every websocket has this header
    Sec-Fetch-Site   "same-origin" if the tuning page sends the request; "none" if the user typed the address

Programs that are not browsers, for example curl, send neither Origin nor Sec-Fetch-Site. Their requests are allowed.
"""

from __future__ import annotations

from tornado.httputil import HTTPServerRequest
from tornado.web import HTTPError, RequestHandler, StaticFileHandler

OWN_PAGE = (None, "same-origin", "none")


def is_allowed(request: HTTPServerRequest, hosts: tuple[str, ...]) -> bool:
    """Return True if the tuning page, the user (a typed address) or a program that is no browser sent the request.

    `hosts` are the allowed values of the header Host.
    """
    headers = request.headers
    return (
        request.host in hosts
        and headers.get("Origin") in (None, *(f"http://{host}" for host in hosts))
        and headers.get("Sec-Fetch-Site") in OWN_PAGE
    )


class GatedHandler(RequestHandler):
    """The base of every handler on the page's port. Before anything else, it refuses forbidden requests with 403."""

    def prepare(self) -> None:
        """Refuse the request if `is_allowed` forbids it."""
        if not is_allowed(self.request, self.settings["hosts"]):
            raise HTTPError(403)


class UnknownPath(GatedHandler):
    """Answers 404 for every path that has no handler."""

    def prepare(self) -> None:
        """Refuse the request with 404."""
        super().prepare()
        raise HTTPError(404)


class StaticHandler(GatedHandler, StaticFileHandler):
    """GET /static/...: the scripts of bokeh."""
