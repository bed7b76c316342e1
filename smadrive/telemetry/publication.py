"""The publication of a command: the publisher process, the counts, and `off` from the broker.

The loop only writes into shared memory. The publisher process has a lower priority. If it dies, it is restarted, and
continues with the first sample that the broker has not confirmed. `off` is a message at the topic PREFIX/RIG/off.
"""

from __future__ import annotations

import secrets
import threading
import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import asdict
from types import TracebackType
from typing import Self

from smadrive.files.extras import check_extra
from smadrive.rig.config import RigConfig
from smadrive.stream.shared_memory import SharedReader, SharedWriter
from smadrive.stream.supervised_process import SupervisedProcess
from smadrive.telemetry.address import BrokerAddress
from smadrive.telemetry.counters import PublisherCounters, PublisherCounts

NICENESS = 5
LOOK_S = 0.05
"""Period at which `off` from the broker is looked for, s."""

CONNECTS_WITHIN_S = 2.0


class Publication:
    """Publishes the rows and the status in the memory of `writer` to a broker; a context manager.

    `command` is the name of the command for the subscribers. If the rig file has `off_by_mqtt = true`, the first `off`
    from the broker calls `on_off`. If `on_off` is still None, the call is made as soon as it is set. ConfigError when
    paho-mqtt is not installed, or when the publisher process does not start.
    """

    def __init__(self, address: BrokerAddress, config: RigConfig, command: str, writer: SharedWriter) -> None:
        check_extra("mqtt", "--publish")
        self.address = address
        self.on_off: Callable[[], None] | None = None
        self._config = config
        self._command = command
        self._writer = writer
        self._reader = SharedReader(writer.memory_fd)
        self._is_ending = threading.Event()

    def __enter__(self) -> Self:
        """Start the publisher process."""
        with ExitStack() as stack:
            self._counters = stack.enter_context(PublisherCounters.created())
            self._publisher = stack.enter_context(self._process())
            if self._config.off_by_mqtt:
                watcher = threading.Thread(target=self._watch_off, name="off by MQTT", daemon=True)
                watcher.start()
                stack.callback(watcher.join)
                stack.callback(self._is_ending.set)
            self._on_exit = stack.pop_all()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End the publisher process, which first sends the remaining messages."""
        self._on_exit.__exit__(kind, error, trace)

    @property
    def pid(self) -> int:
        """The id of the publisher process, which changes with a restart."""
        return self._publisher.pid

    @property
    def has_begun(self) -> bool:
        """True if the publisher process was started."""
        return hasattr(self, "_on_exit")

    @property
    def counts(self) -> PublisherCounts:
        """The present counts."""
        return self._counters.counts(self._reader.written)

    def wait_for_broker(self) -> bool:
        """Wait until the broker is connected, at most `CONNECTS_WITHIN_S`. Return True if it is connected.

        If the rig file permits `off`, also wait until the broker has answered the subscription to it. Call this before
        the loop begins.
        """
        give_up_s = time.monotonic() + CONNECTS_WITHIN_S
        while not self._counters["is_ready"] and time.monotonic() < give_up_s:
            time.sleep(LOOK_S)
        return bool(self._counters["is_ready"])

    def _process(self) -> SupervisedProcess:
        fds = {"memory_fd": self._writer.memory_fd, "counters_fd": self._counters.memory_fd}
        parameters = {
            **fds,
            "address": asdict(self.address),
            "prefix": self.address.prefix,
            "rig": self._config.name,
            "command": self._command,
            "client_id": f"smadrive-{secrets.token_hex(6)}",
            "may_switch_off": self._config.off_by_mqtt,
        }
        return SupervisedProcess(
            "smadrive.telemetry.process", parameters, tuple(fds.values()), extra="mqtt", niceness=NICENESS
        )

    def _watch_off(self) -> None:
        while not self._is_ending.wait(LOOK_S):
            if self._counters["offs"] and self.on_off is not None:
                self.on_off()
                return
