"""Waiting for readable descriptors with `poll`, which has no limit of descriptor numbers (`select`: 1024)."""

from __future__ import annotations

import select
import time
from collections.abc import Iterable


def readable(descriptors: Iterable[int], timeout_s: float | None) -> list[int]:
    """Return the descriptors that are readable within `timeout_s`. Without a timeout (None), wait for the first.

    `poll` counts in whole milliseconds. The function sleeps for the remaining fraction, so that a reply is in time.
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
