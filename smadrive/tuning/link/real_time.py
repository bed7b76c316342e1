"""Real-time scheduling of the loop, so that its ticks begin on time although a browser keeps every core busy."""

from __future__ import annotations

import gc
import os
from contextlib import suppress

PRIORITY = 1
NICENESS = -10


def use_real_time_scheduling() -> None:
    """Call it once, in the loop's thread, after everything has been loaded and started.

    Where the system grants it, the thread runs as soon as it is ready, before all ordinary threads; a niceness decides
    only about shares in the long run. Processes that are started later have ordinary scheduling. Loaded objects are
    excluded from garbage collection: a collection of all of them would take longer than a tick.
    """
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(PRIORITY))
    except (OSError, AttributeError):  # not granted; not Linux
        with suppress(OSError):
            os.setpriority(os.PRIO_PROCESS, 0, NICENESS)
    gc.collect()
    gc.freeze()
