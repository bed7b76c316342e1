"""Publishes the rows and the status of a loop from shared memory. It runs in the publisher process (process.py).

The ring of rows is the queue. If the broker is away for too long, the loop overwrites the oldest rows before they are
sent. These rows are counted as dropped. At most `IN_FLIGHT` samples are in flight: handed to the connection, but not
confirmed yet. So the memory of the process does not grow. A retained message is sent when it changes. It never waits
for the confirmation of samples: the end of a run and its faults have precedence over samples. Without a status nothing
is sent: the command has no open rig yet, and another program may publish the same rig. After a reconnection all
retained messages are sent again, because a restarted broker may have forgotten them.
"""

from __future__ import annotations

import json
import time
from collections import deque
from typing import Any

from smadrive.stream.shared_memory import SharedReader
from smadrive.telemetry.broker import Broker, Delivery
from smadrive.telemetry.counters import PublisherCounters
from smadrive.telemetry.schema import (
    ENDED,
    GONE,
    ONLINE,
    VERSION,
    faults_message,
    sample_message,
    schema_document,
    state_message,
    topic_of,
)

IN_FLIGHT = 100
"""Largest number of samples that are sent before the first of them is confirmed."""

COUNTS_S = 5.0
"""Shortest time between two messages at the topic `publisher`, s."""


class Publisher:
    """Moves rows and status to the broker with each call of `step`, which does not wait."""

    def __init__(
        self,
        reader: SharedReader,
        counters: PublisherCounters,
        broker: Broker,
        *,
        prefix: str,
        rig: str,
        command: str,
    ) -> None:
        self._reader = reader
        self._counters = counters
        self._broker = broker
        self._place = prefix, rig
        self._command = command
        self._next = counters["confirmed_to"]
        self._outstanding: deque[tuple[int, int, Delivery]] = deque()
        self._version = -1
        self._status: dict[str, Any] = {}
        self._sent: dict[str, str] = {}
        self._end: Delivery | None = None
        self._connections = 0
        self._connections_before = counters["connections"]
        self._counts_due_s = 0.0

    def step(self) -> None:
        """Publish what is new, as far as the connection permits."""
        if self._may_publish():
            self._publish_retained()
            self._publish_change("driver", ONLINE)
            self._publish_samples()

    @property
    def is_done(self) -> bool:
        """True if the broker has confirmed every sample."""
        return self._next >= self._reader.written and not self._outstanding

    @property
    def is_behind(self) -> bool:
        """True if the broker is connected, and more samples wait than may be in flight."""
        return self._broker.is_connected and self._reader.written - self._next > IN_FLIGHT

    def finish(self) -> bool:
        """Publish the end without waiting, but no more samples. Return True if the broker has confirmed the end.

        The end is ENDED if the driver has ended its command, otherwise GONE. Call `finish` until it returns True: while
        the broker is not connected, and after a reconnection, there is still something to publish. If there was no
        status, nothing was published, so there is no end to confirm and the result is True.
        """
        if self._may_publish():
            if self._end is None:
                self._counts_due_s = 0.0
            self._publish_retained()
            self._publish_end()
        return not self._status or (self._end is not None and self._end.is_published())

    def _may_publish(self) -> bool:
        """Read what is new. Return True if there is a status, and a connection that was not made just now."""
        self._read_status()
        self._confirm()
        is_new = self._note_connection()
        return bool(self._status) and self._broker.is_connected and not is_new

    def _read_status(self) -> None:
        status = self._reader.status(self._version)
        if status is not None:
            self._version, self._status = status

    def _note_connection(self) -> bool:
        """Update the counts of the connection. Return True if a new connection was made since the last step.

        A new connection first repeats its unconfirmed messages. So new messages wait until the next step: otherwise an
        older state could arrive after a newer one. After a new connection all retained messages must be sent again.
        """
        is_new = self._broker.connections != self._connections
        if is_new:
            self._connections = self._broker.connections
            self._sent.clear()
            self._end = None
            self._counters["connections"] = self._connections_before + self._connections
        is_ready = self._broker.is_ready  # read first: an answer that arrives now must not be ready without its trouble
        self._counters.trouble = self._broker.trouble
        self._counters["is_ready"] = is_ready
        return is_new

    def _confirm(self) -> None:
        """Count the samples that the broker has confirmed, and the rows that were dropped before them."""
        while self._outstanding and self._outstanding[0][2].is_published():
            number, dropped, _ = self._outstanding.popleft()
            self._counters["dropped"] += dropped
            self._counters["confirmed_to"] = number + 1

    def _publish_retained(self) -> None:
        self._publish_change("schema", json.dumps(schema_document()))
        self._publish_change("state", json.dumps(state_message(self._status, self._command)))
        self._publish_change("faults", json.dumps(faults_message(self._status)))
        if time.monotonic() >= self._counts_due_s:
            self._counts_due_s = time.monotonic() + COUNTS_S
            self._publish_change("publisher", json.dumps(self._counts()))

    def _publish_end(self) -> None:
        """Publish the end after the other retained messages: its confirmation confirms them, too."""
        end = self._publish_change("driver", GONE if self._status.get("end") is None else ENDED)
        self._end = end or self._end

    def _publish_change(self, message: str, payload: str) -> Delivery | None:
        """Publish a retained message if it differs from the one that was sent. Return None if it does not."""
        if self._sent.get(message) == payload:
            return None
        self._sent[message] = payload
        return self._publish(message, payload, retain=True)

    def _publish_samples(self) -> None:
        """Hand new rows to the connection, each with the number of rows that were overwritten before it."""
        began_unix_s = self._status.get("began_unix_s")
        if began_unix_s is None:
            return
        numbers, rows = self._reader.rows(self._next, IN_FLIGHT - len(self._outstanding))
        for number, row in zip(numbers.tolist(), rows.tolist(), strict=True):
            message = json.dumps(sample_message(number, began_unix_s, row))
            self._outstanding.append((number, number - self._next, self._publish("sample", message)))
            self._next = number + 1

    def _publish(self, message: str, payload: str, *, retain: bool = False) -> Delivery:
        return self._broker.publish(topic_of(*self._place, message), payload, retain=retain)

    def _counts(self) -> dict[str, int]:
        counts = self._counters.counts(self._reader.written)._asdict()
        return {"schema": VERSION, **{name: count for name, count in counts.items() if name != "trouble"}}
