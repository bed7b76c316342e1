"""A message that finds no connection is not confirmed, and is no error. A refused subscription is a trouble."""

import errno
import os
import socket
import threading
from contextlib import contextmanager

import pytest
from peers.mosquitto import wait_for

pytest.importorskip("paho.mqtt.client", reason="needs paho-mqtt (extra `mqtt`)")

from smadrive.cli.live.publishing import open_publication
from smadrive.cli.terminal.output import Output
from smadrive.rig.config import load_rig
from smadrive.stream.shared_memory import SharedWriter
from smadrive.telemetry.address import parse_address
from smadrive.telemetry.broker import Broker
from smadrive.telemetry.schema import topic_of


def test_message_without_a_connection_is_not_confirmed():
    with socket.create_server(("127.0.0.1", 0)) as closed_soon:
        port = closed_soon.getsockname()[1]
    broker = Broker(parse_address(f"mqtt://127.0.0.1:{port}", {}), "driver", ("will", "gone"), None, lambda: None)
    try:
        assert not broker.publish("topic", "text").is_published()
        assert not broker.is_connected
        wait_for(lambda: os.strerror(errno.ECONNREFUSED) in broker.trouble)
    finally:
        broker.close()


CONNACK, ACCEPTED, REFUSED = bytes((0x20, 2, 0, 0)), 1, 0x80


@contextmanager
def broker_that_answers(granted):
    """A broker that accepts a connection, and answers its subscription with the byte `granted`. Yields its port."""
    with socket.create_server(("127.0.0.1", 0)) as listening:
        thread = threading.Thread(target=accept_and_answer, args=(listening, granted))
        thread.start()
        yield listening.getsockname()[1]
        thread.join()


def accept_and_answer(listening, granted):
    connection = listening.accept()[0]
    with connection:
        connection.recv(1000)
        connection.sendall(CONNACK)
        subscribe = connection.recv(1000)
        connection.sendall(bytes((0x90, 3, *subscribe[2:4], granted)))
        while connection.recv(1000):
            pass


@pytest.mark.parametrize(("granted", "is_refused"), [(ACCEPTED, False), (REFUSED, True)])
def test_refused_subscription_is_a_trouble_of_a_connected_broker(granted, is_refused):
    with broker_that_answers(granted) as port:
        address = parse_address(f"mqtt://127.0.0.1:{port}", {})
        broker = Broker(address, "driver", ("will", "gone"), "rig/off", lambda: None)
        try:
            wait_for(lambda: broker.is_ready)
            assert broker.is_connected
            assert bool(broker.trouble) == is_refused
            assert ("rig/off" in broker.trouble) == is_refused
        finally:
            broker.close()


@pytest.mark.parametrize(("as_json", "stream"), [(False, "out"), (True, "err")])
def test_command_reports_a_refused_subscription_and_the_counts(as_json, stream, capsys):
    """With `--json`, stdout is left to the JSON objects."""
    config = load_rig("in-process").model_copy(update={"off_by_mqtt": True})
    with (
        broker_that_answers(REFUSED) as port,
        SharedWriter() as writer,
        open_publication(f"mqtt://127.0.0.1:{port}", config, "run", writer, Output(as_json)) as publication,
    ):
        topic = topic_of(publication.address.prefix, config.name, "off")
        assert topic in publication.counts.trouble
        begun = capsys.readouterr()
    ended = capsys.readouterr()
    assert topic in getattr(begun, stream)
    assert "0 samples" in getattr(ended, stream)
    assert not as_json or (begun.out, ended.out) == ("", "")
