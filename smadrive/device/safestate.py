"""How a device is brought to its safe state on a bad bus, and how it is seen that the heat has ended.

Every step is tried, again and again; one that fails does not keep the others from being tried: any may end the heat.
What a device says of itself is not all: the current that it measures must be gone, too.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from smadrive.clock import Clock
from smadrive.device.heatsource import HeatSource, Supplied
from smadrive.errors import DeviceError, ProtocolError, SafetyError, SmadriveError, TransportError

PAUSES_S = (0.0, 0.0, 0.5, 0.5)
"""Between the attempts: a spoilt reply is tried again at once, a plug that slipped out later."""

CURRENT_ZERO_A = 0.05
"""Less than this is the noise of a current sense."""
ZERO_SHARE = 0.1
"""And no more than this part of current_max_a, for thin wires."""
CURRENT_GONE_S = 0.2
"""How long after switching off, beside the time in which the source settles, current may still be seen."""
LOOK_AGAIN_S = 0.05


def insist(steps: Sequence[Callable[[], None]], clock: Clock) -> None:
    """Take all steps until none of them fails; raises the first error of the last round."""
    for pause_s in (*PAUSES_S, None):
        failed: SmadriveError | None = None
        for step in steps:
            try:
                step()
            except (TransportError, ProtocolError, DeviceError) as error:
                failed = failed or error
        if failed is None:
            return
        if pause_s is None:
            raise failed
        clock.sleep_until(clock.now_s() + pause_s)


def see_it_off(source: HeatSource, current_max_a: float, clock: Clock) -> Supplied:
    """What `source`, in its safe state, says when no current flows any more.

    SafetyError when some does all the same, or it claims to be armed still.
    """
    give_up_s = clock.now_s() + source.settle_s + CURRENT_GONE_S
    while True:
        try:
            supplied = source.exchange(0.0)
        except (TransportError, ProtocolError):
            if clock.now_s() >= give_up_s:
                raise
            continue
        flows = not supplied.current_a <= min(CURRENT_ZERO_A, ZERO_SHARE * current_max_a)
        if not (flows or supplied.armed):
            return supplied
        if clock.now_s() >= give_up_s:
            what = f"{supplied.current_a:.3f} A still flow" if flows else "the device claims to be armed"
            raise SafetyError(f"{what} although the heater is off: cut its supply")
        clock.sleep_until(clock.now_s() + LOOK_AGAIN_S)
