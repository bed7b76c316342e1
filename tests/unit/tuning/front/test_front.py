"""The page's port: OFF is always answered; only requests of the page itself and of local programs are accepted."""

import asyncio
import http.client
import json
import os
import secrets
import signal
import socket
from contextlib import ExitStack, contextmanager
from urllib.parse import urlsplit

import pytest
from marks import exhaustive
from tornado.websocket import websocket_connect

from smadrive.errors import ConfigError
from smadrive.rig.config import rig_file
from smadrive.stream import supervised_process
from smadrive.tuning import processes
from smadrive.tuning.front.process import MAX_BODY_BYTES, MAX_CONNECTIONS, MAX_HEAD_BYTES
from smadrive.tuning.front.relay import MAX_BUILDS
from smadrive.tuning.link.channel import DriverEnd, PageEnd
from smadrive.tuning.processes import TuningPage
from tests.unit.tuning.conftest import TunedRig, true_wire

LOADS = 200
PATIENCE_S = 300.0
FOREIGN = [
    {"Host": "elsewhere.example:5006"},
    {"Origin": "http://elsewhere.example"},
    {"Origin": "http://127.0.0.1:1"},
    {"Origin": "null"},
    {"Sec-Fetch-Site": "cross-site"},
    {"Sec-Fetch-Site": "same-site"},
]
OWN = (None, "none", "same-origin")
"""The values of the header Sec-Fetch-Site of local programs and of the page itself."""
UPGRADE = {
    "Upgrade": "websocket",
    "Connection": "Upgrade",
    "Sec-WebSocket-Version": "13",
    "Sec-WebSocket-Key": "a" * 22,
}
REQUESTS = [
    ("GET", "/", {}),
    ("GET", "/ws", UPGRADE),
    ("GET", "/state", UPGRADE),
    ("GET", "/static/js/bokeh.min.js", {}),
    ("GET", "/metadata", {}),
    ("POST", "/off", {}),
]


class Served:
    """The tuning page of a session that does not run any more, on a port of its own."""

    def __init__(self, driver_end, folder):
        TunedRig(true_wire(), driver_end).run(until_s=1.0)
        self.channel = PageEnd(driver_end.memory_fd, driver_end.page_socket)
        self.page = TuningPage(
            driver_end, port=0, token=secrets.token_urlsafe(8), rig_file=rig_file("simulated"), folder=folder
        )

    @property
    def host(self):
        return urlsplit(self.page.url).netloc

    def status(self, method, path, headers=()):
        """Send one request, and return the status of the reply."""
        connection = http.client.HTTPConnection(self.host, timeout=60.0)
        connection.request(method, path, headers=dict(headers))
        status = connection.getresponse().status
        connection.close()
        return status

    def pending(self, request):
        """Send `request` on a new connection, and return the connection."""
        connection = socket.create_connection(self.host.split(":"), timeout=PATIENCE_S)
        connection.sendall(request.encode())
        return connection


@pytest.fixture(scope="module")
def served(tmp_path_factory):
    with DriverEnd() as driver_end:
        served = Served(driver_end, tmp_path_factory.mktemp("saved"))
        with served.page:
            yield served


@contextmanager
def stopped(pid):
    os.kill(pid, signal.SIGSTOP)
    try:
        yield
    finally:
        os.kill(pid, signal.SIGCONT)


@pytest.mark.exhaustive
def test_off_is_answered_while_200_page_loads_are_pending(served):
    offs = served.channel.offs
    with ExitStack() as stack:
        with stopped(served.page.server.pid):
            load = f"GET / HTTP/1.1\r\nHost: {served.host}\r\n\r\n"
            loads = [stack.enter_context(served.pending(load)) for _ in range(LOADS)]
            assert served.status("POST", "/off") == 200
            assert served.channel.offs == offs + 1
        replies = [load.recv(12) for load in loads]
    assert replies.count(b"HTTP/1.1 200") == MAX_BUILDS
    assert replies.count(b"HTTP/1.1 503") == LOADS - MAX_BUILDS


@pytest.mark.parametrize("foreign", FOREIGN)
@pytest.mark.parametrize(("method", "path", "headers"), REQUESTS)
def test_requests_of_other_sites_are_refused_on_every_path(served, method, path, headers, foreign):
    offs = served.channel.offs
    assert served.status(method, path, {**headers, **foreign}) == 403
    assert served.channel.offs == offs


@pytest.mark.parametrize(
    ("method", "path", "site"),
    [
        *(("POST", "/off", site) for site in OWN),
        *(("GET", "/static/js/bokeh.min.js", site) for site in OWN),
        ("GET", "/", "same-origin"),
        *(exhaustive("GET", "/", site) for site in (None, "none")),  # each builds a page
    ],
)
def test_requests_of_the_page_and_of_local_programs_are_accepted(served, method, path, site):
    assert served.status(method, path, {} if site is None else {"Sec-Fetch-Site": site}) == 200


def test_off_is_answered_despite_many_idle_connections(served):
    with ExitStack() as stack:
        for _ in range(MAX_CONNECTIONS + 50):
            stack.enter_context(served.pending(""))
        assert served.status("POST", "/off") == 200


@pytest.mark.parametrize("size", ["Content-Length: 99000000\r\n\r\n", "Transfer-Encoding: chunked\r\n\r\n186a0\r\n"])
@pytest.mark.parametrize("path", ["/off", "/", "/elsewhere"])
def test_large_body_is_refused_before_it_arrives(served, path, size):
    offs = served.channel.offs
    head = f"POST {path} HTTP/1.1\r\nHost: {served.host}\r\nContent-Type: application/x-www-form-urlencoded\r\n{size}"
    with served.pending(head) as connection:
        assert connection.recv(12) == b"HTTP/1.1 400"
    assert served.channel.offs == offs


def test_large_head_closes_the_connection(served):
    with served.pending(f"GET /elsewhere?{'a' * 2 * MAX_HEAD_BYTES}") as connection:
        assert connection.recv(100) == b""


def test_body_that_does_not_arrive_closes_the_connection(served):
    with served.pending(f"POST /off HTTP/1.1\r\nHost: {served.host}\r\nContent-Length: 9\r\n\r\n") as connection:
        assert connection.recv(100) == b""


def test_off_with_a_small_body_is_counted(served):
    offs = served.channel.offs
    request = f"POST /off HTTP/1.1\r\nHost: {served.host}\r\nContent-Length: 2\r\n\r\n{{}}"
    with served.pending(request) as connection:
        assert connection.recv(12) == b"HTTP/1.1 200"
    assert served.channel.offs == offs + 1


def test_long_message_closes_the_state_socket(served):
    async def reply():
        state = await websocket_connect(f"ws://{served.host}/state")
        await state.read_message()
        await state.write_message("a" * 2 * MAX_BODY_BYTES)
        last = await asyncio.wait_for(state.read_message(), PATIENCE_S)
        state.close()
        return last

    assert asyncio.run(reply()) is None


def test_off_during_a_restart_of_the_front_process_is_counted(served):
    offs = served.channel.offs
    os.kill(served.page.front.pid, signal.SIGKILL)
    assert served.status("POST", "/off") == 200
    assert served.channel.offs == offs + 1


def test_frozen_front_process_is_replaced_and_off_is_counted(served):
    offs, frozen = served.channel.offs, served.page.front.pid
    os.kill(frozen, signal.SIGSTOP)
    assert served.status("POST", "/off") == 200
    assert served.page.front.pid != frozen
    assert served.channel.offs == offs + 1


def test_taken_port_is_refused(served, driver_end, tmp_path):
    port = urlsplit(served.page.url).port
    page = TuningPage(driver_end, port=port, token="", rig_file=rig_file("simulated"), folder=tmp_path)
    with pytest.raises(ConfigError), page:
        pass


@pytest.mark.exhaustive
def test_last_message_to_a_page_is_how_the_run_has_ended(driver_end, tmp_path, monkeypatch):
    monkeypatch.setattr(processes, "FROZEN_LOOKS", 1_000_000)  # a busy machine may stop the front process for a second
    monkeypatch.setattr(supervised_process, "END_WITHIN_S", PATIENCE_S)

    async def messages():
        """Return the messages before the end of the run and after it. The page process may be slow at any time."""
        served = Served(driver_end, tmp_path)
        with served.page:
            state = await websocket_connect(f"ws://{served.host}/state")
            before = [json.loads(await state.read_message())]
            while before[-1]["page"] != served.page.server.pid:
                before.append(json.loads(await state.read_message()))
            await asyncio.to_thread(served.page.__exit__, None, None, None)
            after = []
            while (message := await state.read_message()) is not None:
                after.append(json.loads(message))
            state.close()
            return before, after

    before, after = asyncio.run(messages())
    assert {message["end"] for message in before + after[:-1]} == {None}
    assert after[-1]["end"] == "off"
