"""Repeats steps on a bad bus, to bring a device to its safe state.

If a step fails with any exception, the other steps are still tried, because each of them may switch a heater off. Only
a guardian that has taken over the devices, or a signal, ends the rounds early.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from smadrive.clock import Clock
from smadrive.errors import TakenOverError

PAUSES_S = (0.0, 0.0, 0.5, 0.5, 0.5, 0.5)
"""Pauses between the rounds of `retry_all`, in seconds.

The first two are 0, because a wrong reply needs no pause. A lost connection needs half a second.
"""


def retry_all(steps: Sequence[Callable[[], None]], clock: Clock) -> None:
    """Run all steps in rounds, until a round has no failed step.

    After the last round, which follows the pauses `PAUSES_S`, raise the first error of that round.
    """
    for pause_s in (*PAUSES_S, None):
        failed: Exception | None = None
        for step in steps:
            try:
                step()
            except TakenOverError:
                raise  # the guardian uses the devices now
            except Exception as error:  # noqa: BLE001  (any error, for example a trace on a full disk)
                failed = failed or error
        if failed is None:
            return
        if pause_s is None:
            raise failed
        clock.sleep_until(clock.now_s() + pause_s)
