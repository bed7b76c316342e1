"""Waiting for readable descriptors with `poll`. Unlike `select`, it also takes descriptors above 1023."""

from __future__ import annotations

import select
import time
from collections.abc import Iterable


def readable(descriptors: Iterable[int], timeout_s: float) -> list[int]:
    """Return the readable descriptors. Wait for at most `timeout_s` until one is readable.

    `poll` counts in whole milliseconds. The function sleeps for the rest of the time, so that no reply is late. Python
    handles a signal that arrives just before `poll` begins only after `poll` has returned.
    """
    poll = select.poll()
    for descriptor in descriptors:
        poll.register(descriptor, select.POLLIN)
    due_s = time.monotonic() + timeout_s
    ready = poll.poll(int(1e3 * timeout_s))
    rest_s = due_s - time.monotonic()
    if not ready and rest_s > 0.0:
        time.sleep(rest_s)
        ready = poll.poll(0)
    return [descriptor for descriptor, _ in ready]
