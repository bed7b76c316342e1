"""The publisher process: it moves rows and status from shared memory to the broker until the driver ends.

Then it sends the remaining samples, for at most `SAMPLES_S`, and the end. All that takes at most `DRAIN_S`.
"""

from __future__ import annotations

import time
from typing import Any

from smadrive.stream.child import is_input_closed, report_ready, run
from smadrive.stream.shared_memory import SharedReader
from smadrive.telemetry.address import BrokerAddress
from smadrive.telemetry.broker import Broker
from smadrive.telemetry.counters import PublisherCounters
from smadrive.telemetry.publisher import Publisher
from smadrive.telemetry.schema import GONE, topic_of

LOOK_S = 0.05
"""Period of `Publisher.step`: one tick at 20 Hz."""

BUSY_S = 0.01
"""Period of `Publisher.step` while the publisher is behind (see `Publisher.is_behind`), and at the end."""

DRAIN_S = 2.0
SAMPLES_S = 1.5
"""Part of `DRAIN_S` for the remaining samples. The rest is left for the confirmation of the end."""


def serve(parameters: dict[str, Any]) -> None:
    """Publish until standard input ends, then publish the end.

    The connection is closed properly only if the broker has confirmed the end. Otherwise the retained messages at the
    broker may be old, such as `online`: the end of this process then makes the broker publish the last will, GONE.
    """
    counters = PublisherCounters(parameters["counters_fd"])
    prefix, rig = parameters["prefix"], parameters["rig"]

    def count_off() -> None:
        counters["offs"] += 1

    broker = Broker(
        BrokerAddress(**parameters["address"]),
        parameters["client_id"],
        (topic_of(prefix, rig, "driver"), GONE),
        topic_of(prefix, rig, "off") if parameters["may_switch_off"] else None,
        count_off,
    )
    reader = SharedReader(parameters["memory_fd"])
    publisher = Publisher(reader, counters, broker, prefix=prefix, rig=rig, command=parameters["command"])
    report_ready()
    while not is_input_closed(BUSY_S if publisher.is_behind else LOOK_S):
        publisher.step()
    if _finish(publisher):
        broker.close()


def _finish(publisher: Publisher) -> bool:
    """Publish the remaining samples and the end. Return True if the broker has confirmed the end."""
    began_s = time.monotonic()
    while not publisher.is_done and time.monotonic() < began_s + SAMPLES_S:
        publisher.step()
        time.sleep(BUSY_S)
    while not (is_confirmed := publisher.finish()) and time.monotonic() < began_s + DRAIN_S:
        time.sleep(BUSY_S)
    return is_confirmed


if __name__ == "__main__":
    run(serve)
