"""What the loop's process does to be on time beside a browser that keeps every core busy."""

from __future__ import annotations

import gc
import os
from contextlib import suppress

PRIORITY = 1
NICENESS = -10


def use_real_time_scheduling() -> None:
    """To be called by the loop's thread, once, after everything has been loaded and started.

    In real time where the system grants it: such a thread runs as soon as it wants to, before whatever else is running;
    a niceness only decides who gets how much in the long run. What it starts later begins as anybody does. And what is
    loaded stays: searching all of it for garbage again and again would take longer than a tick.
    """
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(PRIORITY))
    except (OSError, AttributeError):  # not granted; not Linux
        with suppress(OSError):
            os.setpriority(os.PRIO_PROCESS, 0, NICENESS)
    gc.collect()
    gc.freeze()
