"""Repeats steps on a bad bus: the way to bring a device to its safe state.

A step that fails, by any exception, does not keep the others from being tried: each of them may end the heat. Only a
guardian that has taken the devices over, or a signal, ends the tries.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from smadrive.clock import Clock
from smadrive.errors import TakenOverError

PAUSES_S = (0.0, 0.0, 0.5, 0.5, 0.5, 0.5)
"""Pauses between the rounds: a wrong reply is tried again at once, a lost connection after half a second."""


def retry_all(steps: Sequence[Callable[[], None]], clock: Clock) -> None:
    """Run all steps in rounds until no step fails; raises the first error of the last round."""
    for pause_s in (*PAUSES_S, None):
        failed: Exception | None = None
        for step in steps:
            try:
                step()
            except TakenOverError:
                raise  # the guardian uses the devices until it frees them
            except Exception as error:  # noqa: BLE001  (a trace on a full disk, for instance)
                failed = failed or error
        if failed is None:
            return
        if pause_s is None:
            raise failed
        clock.sleep_until(clock.now_s() + pause_s)
