"""Which descriptors have something to read. `poll` has no limit of descriptor numbers, as `select` has at 1024."""

from __future__ import annotations

import select
import time
from collections.abc import Iterable


def readable(descriptors: Iterable[int], timeout_s: float | None) -> list[int]:
    """Those that are readable within `timeout_s`; None waits until one is.

    `poll` counts in milliseconds. The rest of a wait is slept, so that a reply leaves when it is due.
    """
    poll = select.poll()
    for descriptor in descriptors:
        poll.register(descriptor, select.POLLIN)
    if timeout_s is None:
        return [descriptor for descriptor, _ in poll.poll()]
    due_s = time.monotonic() + timeout_s
    ready = poll.poll(int(1e3 * timeout_s))
    rest_s = due_s - time.monotonic()
    if not ready and rest_s > 0.0:
        time.sleep(rest_s)
        ready = poll.poll(0)
    return [descriptor for descriptor, _ in ready]
