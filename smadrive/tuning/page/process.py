"""The page process: it builds the pages and serves their data. Only the front process connects to it.

The loop never waits for the page process. Nothing is loaded from the network: all scripts and styles come from the
installed packages. The process listens on a Unix socket in a private folder of the user. So only requests that have
passed the gate of the front process (front/gate.py) reach this process.
"""

from __future__ import annotations

import logging
import socket
import sys
from pathlib import Path
from typing import Any

from bokeh.application import Application
from bokeh.application.handlers.function import FunctionHandler
from bokeh.document import Document
from bokeh.server.server import Server
from tornado.ioloop import PeriodicCallback

from smadrive.stream.child import is_input_closed, report_ready, run
from smadrive.tuning.link.address import page_hosts
from smadrive.tuning.link.channel import PageEnd
from smadrive.tuning.page.client_registry import ClientRegistry
from smadrive.tuning.page.fit import Fitter
from smadrive.tuning.page.page import Page
from smadrive.tuning.page.view.sample_history import SampleHistory
from smadrive.tuning.page.view.watch_page import WatchPage

READ_MS = 50
UNUSED_MS = 1000
"""A client counts as gone when its websocket has been closed for this time."""


def serve(parameters: dict[str, Any]) -> None:
    """Serve pages until standard input ends. `parameters` are those of PageProcess in processes.py."""
    channel = PageEnd(parameters["memory_fd"], socket.socket(fileno=parameters["socket_fd"]))
    clients, fitter = ClientRegistry(channel, parameters.get("token")), Fitter()
    history = SampleHistory(channel)

    def document(doc: Document) -> None:
        if "token" in parameters:
            Page(doc, clients, fitter, history, Path(parameters["folder"]), Path(parameters["rig_file"]))
        else:
            WatchPage(doc, clients, history)

    def read() -> None:
        clients.read()
        history.read()
        channel.beat()

    clients.read()
    while not clients.status:  # a page needs a status; the driver may still be writing the first one
        if is_input_closed(within_s=READ_MS / 1000):
            return
        clients.read()
    server = Server(
        {"/": Application(FunctionHandler(document))},
        unix_socket=parameters["path"],
        allow_websocket_origin=list(page_hosts(parameters["port"])),
        check_unused_sessions_milliseconds=UNUSED_MS // 2,
        unused_session_lifetime_milliseconds=UNUSED_MS,
    )
    server.start()
    server.io_loop.add_handler(sys.stdin.fileno(), lambda *_: server.io_loop.stop(), server.io_loop.READ)
    PeriodicCallback(read, READ_MS).start()
    report_ready()
    server.io_loop.start()
    server.stop()
    fitter.close()


if __name__ == "__main__":
    logging.getLogger("bokeh").setLevel(logging.ERROR)  # bokeh warns of every client that leaves
    run(serve)
