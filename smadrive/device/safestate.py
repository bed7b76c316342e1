"""How a device is brought to its safe state on a bad bus: every step tried, again and again.

A step that fails does not keep the others from being tried: any of them may end the heat.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from smadrive.clock import Clock
from smadrive.errors import ExceptionReply, ProtocolError, ReadBackError, SmadriveError, TransportError

PAUSES_S = (0.0, 0.0, 0.5, 0.5)
"""Between the attempts: a spoilt reply is tried again at once, a plug that slipped out later."""


def insist(steps: Sequence[Callable[[], None]], clock: Clock) -> None:
    """Take all steps until none of them fails; raises the first error of the last round."""
    for pause_s in (*PAUSES_S, None):
        failed: SmadriveError | None = None
        for step in steps:
            try:
                step()
            except (TransportError, ProtocolError, ExceptionReply, ReadBackError) as error:
                failed = failed or error
        if failed is None:
            return
        if pause_s is None:
            raise failed
        clock.sleep_until(clock.now_s() + pause_s)
