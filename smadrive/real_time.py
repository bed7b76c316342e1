"""Real-time scheduling of the loop, the guardian and a served simulator, so that they are on time on a busy machine.

With ordinary scheduling, a browser that keeps every core busy would delay the ticks of the loop and the replies of the
simulator. If a loop hangs under real-time scheduling, it leaves hardly any time to other processes on its core. So the
guardian has a higher priority than the loop.
"""

from __future__ import annotations

import gc
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress

LOOP_PRIORITY = 1
GUARDIAN_PRIORITY = 2
NICENESS = -10


def use_real_time_scheduling(priority: int = LOOP_PRIORITY) -> None:
    """Give the calling thread real-time scheduling; if the system forbids it, a higher priority by its niceness.

    If the system forbids both, the scheduling stays ordinary.

    Call this function once, in the thread of the loop, of the guardian or of the simulator, after everything has been
    loaded and started. With real-time scheduling, the thread runs as soon as it is ready, before all ordinary threads
    and all threads of a lower `priority`; a niceness only gives it a larger share of the processor. Processes that are
    started later have ordinary scheduling. Loaded objects are excluded from garbage collection, because collecting all
    of them would take longer than a tick.
    """
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(priority))
    except (OSError, AttributeError):  # the system does not grant it, or is not Linux
        with suppress(OSError):
            os.setpriority(os.PRIO_PROCESS, 0, NICENESS)
    gc.collect()
    gc.freeze()


@contextmanager
def real_time_scheduling() -> Iterator[None]:
    """Give the calling thread real-time scheduling during the `with` block, and its own scheduling again afterwards.

    See use_real_time_scheduling. A thread that has real-time scheduling already keeps it.
    """
    if not hasattr(os, "sched_getscheduler") or os.sched_getparam(0).sched_priority > 0:
        yield
        return
    policy, niceness = os.sched_getscheduler(0), os.getpriority(os.PRIO_PROCESS, 0)
    is_frozen = gc.get_freeze_count() > 0
    use_real_time_scheduling()
    try:
        yield
    finally:
        with suppress(OSError):
            os.sched_setscheduler(0, policy | os.SCHED_RESET_ON_FORK, os.sched_param(0))
            os.setpriority(os.PRIO_PROCESS, 0, niceness)
        if not is_frozen:
            gc.unfreeze()
