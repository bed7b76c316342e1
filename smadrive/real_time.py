"""Real-time scheduling of the loop and of a served simulator, so that they work on time on a busy machine.

Without it, a browser that keeps every core busy would delay the ticks of the loop and the replies of the simulator.
"""

from __future__ import annotations

import gc
import os
from contextlib import suppress

PRIORITY = 1
NICENESS = -10


def use_real_time_scheduling() -> None:
    """Give the calling thread real-time scheduling, or else a higher priority (niceness), if the system permits either.

    Call this function once, in the thread of the loop or of the simulator, after everything has been loaded and
    started. With real-time scheduling, the thread runs as soon as it is ready, before all ordinary threads; a niceness
    only gives it a larger share of the processor. Processes that are started later have ordinary scheduling. Loaded
    objects are excluded from garbage collection, because collecting all of them would take longer than a tick.
    """
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(PRIORITY))
    except (OSError, AttributeError):  # the system does not grant it, or is not Linux
        with suppress(OSError):
            os.setpriority(os.PRIO_PROCESS, 0, NICENESS)
    gc.collect()
    gc.freeze()
