"""The end of a command has precedence over waiting samples. Without its confirmation the last will replaces it."""

import json
import socket
import threading
import time
from contextlib import contextmanager, suppress

import pytest
from marks import exhaustive
from peers import mosquitto
from peers.mosquitto import MosquittoBroker, Subscriber, wait_for

pytest.importorskip("paho.mqtt.client", reason="needs paho-mqtt (extra `mqtt`)")

from smadrive.errors import TripError
from smadrive.safety.faults import Fault, Trip
from smadrive.stream.shared_memory import CAPACITY

from .conftest import Published

CONNECT, PUBLISH, DISCONNECT = 1, 3, 14
"""Types of packets."""

CONNACK = bytes((0x20, 2, 0, 0))
CONFIRMS_AFTER_S = 0.001


class SlowBroker:
    """A broker for one connection, which confirms each message after `CONFIRMS_AFTER_S`, or without `confirms` never.

    `kinds` are the types of the received packets, `messages` the topics and texts of the received messages.
    """

    def __init__(self, *, confirms):
        self.kinds = []
        self.messages = []
        self._confirms = confirms

    @contextmanager
    def running(self):
        """Yield the address of the broker. At the end wait until the connection is closed."""
        with socket.create_server(("127.0.0.1", 0)) as listening:
            thread = threading.Thread(target=self._serve, args=(listening,))
            thread.start()
            yield f"mqtt://127.0.0.1:{listening.getsockname()[1]}"
            thread.join()

    def last(self, name):
        """The last text of the topic that ends with `name`."""
        return [text for topic, text in self.messages if topic.endswith(f"/{name}")][-1]

    def _serve(self, listening):
        connection = listening.accept()[0]
        with connection, connection.makefile("rb") as stream, suppress(OSError):
            while head := stream.read(1):
                self.kinds.append(head[0] >> 4)
                body = stream.read(length_of(stream))
                if self.kinds[-1] == CONNECT:
                    connection.sendall(CONNACK)
                elif self.kinds[-1] == PUBLISH:
                    self._take(body, connection)

    def _take(self, body, connection):
        end = 2 + int.from_bytes(body[:2], "big")
        self.messages.append((body[2:end].decode(), body[end + 2 :].decode()))
        if self._confirms:
            time.sleep(CONFIRMS_AFTER_S)
            connection.sendall(bytes((0x40, 2)) + body[end : end + 2])


class ForgetfulBroker(SlowBroker):
    """A broker that restarts when it gets the end of the command, before it confirms it.

    It has then forgotten all messages: `messages` has those of the second connection.
    """

    def _serve(self, listening):
        self._is_first = True
        super()._serve(listening)
        self._is_first = False
        self.messages.clear()
        super()._serve(listening)

    def _take(self, body, connection):
        if self._is_first and body.endswith(b"ended"):
            raise ConnectionResetError
        super()._take(body, connection)


def length_of(stream):
    """The number of bytes that a packet has after its head."""
    length = shift = 0
    while True:
        byte = stream.read(1)[0]
        length |= (byte & 0x7F) << shift
        if byte < 0x80:
            return length
        shift += 7


@pytest.mark.parametrize(("confirms", "samples"), [(False, 150), exhaustive(True, CAPACITY - 1)])
def test_end_has_precedence_over_waiting_samples(confirms, samples):
    """Only after a confirmed end the driver disconnects. Otherwise the broker must publish the last will."""
    broker = SlowBroker(confirms=confirms)
    with broker.running() as url, pytest.raises(TripError):
        tripped(Published(url), samples)
    assert broker.last("driver") == "ended"
    state, faults = json.loads(broker.last("state")), json.loads(broker.last("faults"))
    assert (state["mode"], state["end"]) == ("off", "off")
    assert (faults["any"], faults["fault_type"]) == (True, "TripError")
    assert (broker.kinds[-1] == DISCONNECT) == confirms


@pytest.mark.exhaustive
def test_broker_that_restarts_at_the_end_gets_every_retained_message_again():
    broker = ForgetfulBroker(confirms=True)
    with broker.running() as url, Published(url) as published:
        published.begin().tick(5)
        wait_for(lambda: published.publication.counts.connections)
    assert broker.last("driver") == "ended"
    assert {"schema", "state", "faults"} <= {topic.rsplit("/", 1)[-1] for topic, _ in broker.messages}


def tripped(published, samples):
    """Publish samples to a broker that is connected, and trip."""
    with published:
        published.begin().tick(samples)
        wait_for(lambda: published.publication.counts.connections)
        raise Trip(Fault.OVER_TEMPERATURE, 7.5, "150 °C").error()


@pytest.mark.skipif(mosquitto.missing() is not None, reason=str(mosquitto.missing()))
@pytest.mark.exhaustive
def test_driver_is_gone_after_an_end_that_the_broker_has_not_confirmed(tmp_path):
    with MosquittoBroker(tmp_path) as broker:
        with Published(broker.url) as published:
            published.begin().tick(20)
            wait_for(lambda: published.publication.counts.waiting == 0)
            broker.hang()
            published.tick(150)
        broker.resume()
        with Subscriber(broker) as late:
            wait_for(lambda: late.texts("driver")[-1:] == ["gone"])
