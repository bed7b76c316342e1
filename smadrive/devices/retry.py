"""Steps on a bad bus, tried again and again: how every device is brought to its safe state.

A step that fails, by whatever exception, does not keep the others from being tried: any of them may end the heat. Only
a guardian that has taken the devices over, and a signal, end the tries.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from smadrive.clock import Clock
from smadrive.errors import TakenOverError

PAUSES_S = (0.0, 0.0, 0.5, 0.5, 0.5, 0.5)
"""Between the attempts: a spoilt reply is tried again at once, a lost connection after half a second."""


def retry_all(steps: Sequence[Callable[[], None]], clock: Clock) -> None:
    """Take all steps until none of them fails; raises the first error of the last round."""
    for pause_s in (*PAUSES_S, None):
        failed: Exception | None = None
        for step in steps:
            try:
                step()
            except TakenOverError:
                raise  # the devices are the guardian's until it lets go of them
            except Exception as error:  # noqa: BLE001  (a trace on a full disk, for instance)
                failed = failed or error
        if failed is None:
            return
        if pause_s is None:
            raise failed
        clock.sleep_until(clock.now_s() + pause_s)
