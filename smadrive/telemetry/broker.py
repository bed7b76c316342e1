"""The connection to an MQTT broker. Only this module imports paho-mqtt.

A thread of paho connects, reconnects and moves the bytes, so only `close` waits. The MQTT session is clean: the broker
keeps nothing of an earlier connection. After a reconnection, paho sends all unconfirmed messages again (QoS 1: each
message arrives at least once).
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any

from paho.mqtt.client import Client, MQTTMessage
from paho.mqtt.enums import CallbackAPIVersion

from smadrive.telemetry.address import BrokerAddress, tls_context

QOS = 1
KEEPALIVE_S = 5
"""A broker that is silent for about twice this time counts as lost."""

RETRY_S = (1, 5)
"""Shortest and longest pause between two attempts to connect."""

MOST_NUMBERS = 65535
"""The largest number of a message in MQTT. The next message has the number 1."""


class Delivery:
    """A message on its way to the broker. `confirmed` holds the numbers of the messages that the broker has confirmed.

    It replaces paho's MQTTMessageInfo. For a message that was published without a connection, the `is_published` of
    MQTTMessageInfo always raises an error, even after paho has sent the message.
    """

    def __init__(self, number: int, confirmed: set[int]) -> None:
        self._number = number
        self._confirmed = confirmed

    def is_published(self) -> bool:
        """Return True if the broker has confirmed the message."""
        return self._number in self._confirmed


class Broker:
    """The connection to a broker, which paho makes in the background.

    will           topic and text that the broker publishes when it loses this program
    command        topic whose messages call `on_command`; None for no such topic. A retained message does not call
                   it, because it is older than this connection
    connections    number of times that the connection was made
    """

    def __init__(
        self,
        address: BrokerAddress,
        client_id: str,
        will: tuple[str, str],
        command: str | None,
        on_command: Callable[[], None],
    ) -> None:
        self.connections = 0
        self._lost = self._refused = ""
        self._is_subscribed = False
        self._command = command
        self._on_command = on_command
        self._latest = 0
        self._confirmed = set[int]()
        self._client = Client(CallbackAPIVersion.VERSION2, client_id=client_id)
        self._client.will_set(*will, qos=QOS, retain=True)
        self._client.reconnect_delay_set(*RETRY_S)
        self._client.max_inflight_messages_set(0)  # no limit: every message is sent at once, in its order
        if address.user is not None:
            self._client.username_pw_set(address.user, address.password)
        if address.tls:
            self._client.tls_set_context(tls_context(address))
        self._client.on_connect = self._connected
        self._client.on_connect_fail = self._failed
        self._client.on_disconnect = self._disconnected
        self._client.on_subscribe = self._subscribed
        self._client.on_message = self._received
        self._client.on_publish = self._published
        self._client.connect_async(address.host, address.port, keepalive=KEEPALIVE_S)
        self._client.loop_start()

    @property
    def is_connected(self) -> bool:
        """True while paho regards the broker as connected. A loss is noticed after about twice `KEEPALIVE_S`."""
        return self._client.is_connected()

    @property
    def is_ready(self) -> bool:
        """True while the broker is connected and has answered the subscription to `command`, if there is one."""
        return self.is_connected and (self._command is None or self._is_subscribed)

    @property
    def trouble(self) -> str:
        """The reason why the broker is not connected, or why `command` has no effect; otherwise empty."""
        return self._refused if self.is_connected else self._lost

    def publish(self, topic: str, payload: str, *, retain: bool = False) -> Delivery:
        """Send a message, without waiting. Without a connection it is sent after the next one is made."""
        number = self._client.publish(topic, payload, QOS, retain).mid
        self._forget_until(number)
        return Delivery(number, self._confirmed)

    def _forget_until(self, number: int) -> None:
        """Forget old confirmations, because paho uses each number again after `MOST_NUMBERS` messages.

        `number` is the number of the latest message. For each new message, the confirmation of one number is
        forgotten: the number that follows half of `MOST_NUMBERS` messages later. So no message loses its own
        confirmation.
        """
        while self._latest != number:
            self._latest = self._latest % MOST_NUMBERS + 1
            self._confirmed.discard((self._latest + MOST_NUMBERS // 2) % MOST_NUMBERS + 1)

    def close(self) -> None:
        """Disconnect, and wait for the end of paho's thread. After a disconnection the broker publishes no will.

        A process that ends without this call loses its connection, so the broker publishes the will.
        """
        self._client.disconnect()
        self._client.loop_stop()

    def _connected(self, client: Client, _data: Any, _flags: Any, reason: Any, _properties: Any) -> None:
        if reason.is_failure:
            self._lost = str(reason)
            return
        self._lost = self._refused = ""
        self._is_subscribed = False
        if self._command is not None:
            client.subscribe(self._command, QOS)
        self.connections += 1

    def _subscribed(self, _client: Client, _data: Any, _number: int, reasons: list[Any], _properties: Any) -> None:
        if any(reason.is_failure for reason in reasons):
            self._refused = f"the broker refuses the subscription to {self._command}, so it cannot stop the command"
        self._is_subscribed = True

    def _published(self, _client: Client, _data: Any, number: int, _reason: Any, _properties: Any) -> None:
        self._confirmed.add(number)

    def _failed(self, _client: Client, _data: Any) -> None:
        self._lost = f"the broker cannot be reached: {_reason(sys.exception())}"

    def _disconnected(self, _client: Client, _data: Any, _flags: Any, reason: Any, _properties: Any) -> None:
        self._lost = self._lost or f"disconnected: {reason}"

    def _received(self, _client: Client, _data: Any, message: MQTTMessage) -> None:
        if not message.retain:
            self._on_command()


def _reason(error: BaseException | None) -> str:
    """Return the text of the error that paho handles while it calls `on_connect_fail`."""
    return getattr(error, "strerror", None) or str(error or "") or "unknown reason"
