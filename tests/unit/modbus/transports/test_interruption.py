"""A signal may interrupt the opening or closing of a connection at any line. No open port may be left behind."""

import os
import socket
from itertools import count

import pytest
from signal_injection import InterruptedLine

from smadrive.modbus.transports import descriptor, serial_port, tcp_socket
from smadrive.modbus.transports.connect import open_transport


@pytest.fixture
def serial_url():
    near, far = os.openpty()
    yield f"serial://{os.ttyname(far)}"
    os.close(near)
    os.close(far)


@pytest.fixture
def listener():
    with socket.create_server(("127.0.0.1", 0)) as server:
        server.setblocking(False)
        yield server


def url_of(listener):
    return f"tcp://127.0.0.1:{listener.getsockname()[1]}"


def open_connections(listener):
    """Accept all connections, close them, and return how many of them the client had open."""
    found = 0
    while True:
        try:
            connection, _ = listener.accept()
        except BlockingIOError:
            return found
        with connection:
            found += is_open(connection)


def is_open(connection):
    connection.setblocking(False)
    try:
        return connection.recv(1) != b""
    except BlockingIOError:
        return True
    except ConnectionResetError:
        return False


def reopen(transport):
    transport.disconnect()
    transport.reopen(transport.clock.now_s() + 5.0)


def test_interrupted_opening_leaves_the_serial_port_free(serial_url):
    for at in count():
        with InterruptedLine(at, descriptor, serial_port) as interruption:
            transport = open_transport(serial_url)
        if not interruption.reached:
            break
        open_transport(serial_url).close()
    transport.close()
    assert at > 20


def test_serial_port_can_be_opened_again_after_an_interruption(serial_url):
    for at in count():
        with open_transport(serial_url) as transport:
            with InterruptedLine(at, descriptor, serial_port) as interruption:
                reopen(transport)
            reopen(transport)
            transport.write(b"x")
        if not interruption.reached:
            break
    assert at > 20


def test_interrupted_reopening_leaves_no_second_connection(listener):
    for at in count():
        with open_transport(url_of(listener)) as transport:
            with InterruptedLine(at, descriptor, tcp_socket) as interruption:
                reopen(transport)
            reopen(transport)
            assert open_connections(listener) == 1
        if not interruption.reached:
            break
    assert at > 30


def test_interrupted_opening_leaves_no_connection(listener):
    for at in count():
        with InterruptedLine(at, descriptor, tcp_socket) as interruption:
            transport = open_transport(url_of(listener))
        if not interruption.reached:
            break
        assert open_connections(listener) == 0
    transport.close()
    assert at > 30
