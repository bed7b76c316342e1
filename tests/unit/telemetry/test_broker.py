"""A message that finds no connection is not confirmed, and is no error."""

import socket

import pytest

pytest.importorskip("paho.mqtt.client", reason="needs paho-mqtt (extra `mqtt`)")

from smadrive.telemetry.address import parse_address
from smadrive.telemetry.broker import Broker


def test_message_without_a_connection_is_not_confirmed():
    with socket.create_server(("127.0.0.1", 0)) as closed_soon:
        port = closed_soon.getsockname()[1]
    broker = Broker(parse_address(f"mqtt://127.0.0.1:{port}", {}), "driver", ("will", "gone"), None, lambda: None)
    try:
        assert not broker.publish("topic", "text").is_published()
        assert not broker.is_connected
    finally:
        broker.close()
