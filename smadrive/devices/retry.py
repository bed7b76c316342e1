"""Repeats the steps that bring a device to its safe state, for a bus with errors.

If a step fails, the other steps are still tried, because each of them may switch a heater off. Two exceptions end the
rounds early: TakenOverError, because the guardian uses the devices now, and a signal such as Ctrl-C.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from smadrive.clock import Clock
from smadrive.errors import TakenOverError

PAUSES_S = (0.0, 0.0, 0.5, 0.5, 0.5, 0.5)
"""Pauses between the rounds of `retry_all`, in seconds.

The first two are 0, because a wrong reply needs no pause. A lost connection needs half a second.
"""
WITHIN_S = 8.0
"""No step of a later round begins after this time in seconds. The first round always runs all steps.

A step may wait several seconds for a silent device. Meanwhile the user waits, and the guardian stands by.
"""


def retry_all(steps: Sequence[Callable[[], None]], clock: Clock) -> None:
    """Run all steps in rounds, until no step fails in a round.

    The pauses between the rounds are `PAUSES_S`. If steps fail in the last round, raise the first error of this round.
    After `WITHIN_S`, raise the first error of the present round or, if none of its steps has failed, of the round
    before.
    """
    give_up_s = clock.now_s() + WITHIN_S
    failed_before: Exception | None = None
    for pause_s in (*PAUSES_S, None):
        failed: Exception | None = None
        for step in steps:
            if failed_before is not None and clock.now_s() >= give_up_s:
                raise failed or failed_before
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
        failed_before = failed
        clock.sleep_until(clock.now_s() + pause_s)
