"""The page process: a web server on 127.0.0.1 for the page, its data, and `POST /off`.

Nothing here can hold the loop up, and nothing leaves the machine: all scripts and styles come from the installed
packages. Who may do what:

    POST /off            everybody on this machine, without token or socket; not pages of other sites (Origin, Host)
    the page's socket    pages of this server alone (Origin); it acts for the one client that brought the token first
"""

from __future__ import annotations

import json
import logging
import os
import signal
import socket
import sys
from pathlib import Path
from typing import Any

from bokeh.application import Application
from bokeh.application.handlers.function import FunctionHandler
from bokeh.document import Document
from bokeh.server.server import Server
from tornado.ioloop import PeriodicCallback
from tornado.web import RequestHandler

from smadrive.tuning.channel import PageEnd
from smadrive.tuning.desk import Desk
from smadrive.tuning.fit import Fitter
from smadrive.tuning.page import Page

ADDRESS = "127.0.0.1"
READ_MS = 50
UNUSED_MS = 1000
"""A client whose socket has been gone for so long has left."""


class OffHandler(RequestHandler):
    """POST /off: the heater goes off at the loop's next tick."""

    def initialize(self, desk: Desk, hosts: list[str]) -> None:
        """Called by tornado with what the route names."""
        self._desk, self._hosts = desk, hosts

    def check_xsrf_cookie(self) -> None:
        """Origin and Host are checked instead: switching off must need no page that was loaded before."""

    def post(self) -> None:
        """Ask for it; 403 for pages of other sites."""
        origin = self.request.headers.get("Origin")
        if self.request.host not in self._hosts or origin not in (None, *(f"http://{host}" for host in self._hosts)):
            self.send_error(403)
            return
        self._desk.channel.request_off()
        self.write({"off": "requested"})


class AliveHandler(RequestHandler):
    """GET /alive: for the page, to know that its server lives and is still the same."""

    def get(self) -> None:
        """Which process this is."""
        self.write(str(os.getpid()))


def serve(told: dict[str, Any]) -> None:
    """Serve until standard input ends."""
    desk = Desk(PageEnd(told["memory_fd"], socket.socket(fileno=told["socket_fd"])), told["token"])
    port = told["port"] or _free_port()
    hosts = [f"{name}:{port}" for name in (ADDRESS, "localhost")]
    fitter = Fitter()
    folder, rig_file = Path(told["folder"]), Path(told["rig_file"])

    def document(doc: Document) -> None:
        Page(doc, desk, fitter, folder, rig_file)

    while not desk.status:  # it is being replaced just now; a page that is asked for at once needs one
        desk.read()
    server = Server(
        {"/": Application(FunctionHandler(document))},
        address=ADDRESS,
        port=port,
        allow_websocket_origin=hosts,
        extra_patterns=[(r"/off", OffHandler, {"desk": desk, "hosts": hosts}), (r"/alive", AliveHandler)],
        check_unused_sessions_milliseconds=UNUSED_MS // 2,
        unused_session_lifetime_milliseconds=UNUSED_MS,
    )
    server.start()
    server.io_loop.add_handler(sys.stdin.fileno(), lambda *_: server.io_loop.stop(), server.io_loop.READ)
    PeriodicCallback(desk.read, READ_MS).start()
    print(json.dumps({"port": port}), flush=True)  # noqa: T201 (the control process reads it)
    server.io_loop.start()
    server.stop()
    fitter.close()


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind((ADDRESS, 0))
        return int(probe.getsockname()[1])


if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    logging.getLogger("bokeh").setLevel(logging.ERROR)  # a client that leaves is no warning
    serve(json.loads(sys.stdin.readline()))
