"""The gate of the tuning page: requests that pages of other web sites cause are refused.

A browser sends requests to 127.0.0.1 for any page of any site, and a name of that site may resolve to 127.0.0.1. Three
headers tell them apart, and no script of a page can change them:

    Host             the name in the address; a foreign name that resolves to this machine is an attack
    Origin           the page that asks, sent with every POST and every websocket
    Sec-Fetch-Site   how that page is related to this one, sent with everything else; "none" is an address typed in

Programs that are no browsers, curl for instance, send neither of the last two and are allowed.
"""

from __future__ import annotations

from tornado.httputil import HTTPServerRequest
from tornado.web import HTTPError, RequestHandler, StaticFileHandler

OWN_PAGE = (None, "same-origin", "none")


def is_allowed(request: HTTPServerRequest, hosts: tuple[str, ...]) -> bool:
    """Whether the page itself, or a program that is no browser, has sent a request."""
    headers = request.headers
    return (
        request.host in hosts
        and headers.get("Origin") in (None, *(f"http://{host}" for host in hosts))
        and headers.get("Sec-Fetch-Site") in OWN_PAGE
    )


class GatedHandler(RequestHandler):
    """The base of every handler on the page's port: 403 for what `is_allowed` refuses, before anything else."""

    def prepare(self) -> None:
        """Refuse the request, or continue with its method."""
        if not is_allowed(self.request, self.settings["hosts"]):
            raise HTTPError(403)


class UnknownPath(GatedHandler):
    """404 for every path without a handler of its own."""

    def prepare(self) -> None:
        """Refuse the request."""
        super().prepare()
        raise HTTPError(404)


class StaticHandler(GatedHandler, StaticFileHandler):
    """Files of a folder."""
