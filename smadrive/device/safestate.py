"""How a device is brought to its safe state on a bad bus, and how it is seen that the heat has ended.

Every step is tried, again and again. A step that fails, by whatever exception, does not keep the others from being
tried: any of them may end the heat. Only a guardian that has taken the devices over, and a signal, end the tries.
What a device says of itself is not all: the current that it measures must be gone, too.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import isnan

from smadrive.clock import Clock
from smadrive.device.heatsource import HeatSource, Supplied
from smadrive.errors import DeviceError, ProtocolError, SafetyError, TakenOverError, TransportError

PAUSES_S = (0.0, 0.0, 0.5, 0.5, 0.5, 0.5)
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


def see_it_off(source: HeatSource, current_max_a: float, clock: Clock) -> Supplied:
    """What `source`, in its safe state, says when no current flows any more.

    SafetyError when some does all the same, or it claims to be armed still.
    """
    give_up_s = clock.now_s() + source.settle_s + CURRENT_GONE_S
    while True:
        try:
            supplied = source.exchange(0.0, proved=True)
        except (TransportError, ProtocolError, DeviceError):
            if clock.now_s() >= give_up_s:
                raise
            clock.sleep_until(clock.now_s() + LOOK_AGAIN_S)
            continue
        flows = not supplied.current_a <= min(CURRENT_ZERO_A, ZERO_SHARE * current_max_a)
        if not (flows or supplied.armed):
            return supplied
        if clock.now_s() >= give_up_s:
            raise SafetyError(f"{_remaining(supplied, flows=flows)} although the heater is off: cut its supply")
        clock.sleep_until(clock.now_s() + LOOK_AGAIN_S)


def _remaining(supplied: Supplied, *, flows: bool) -> str:
    """Why `supplied` does not show that the heat has ended."""
    if not flows:
        return "the device claims to be armed"
    if isnan(supplied.current_a):
        return f"the current is unknown ({supplied.problem or 'no reading'})"
    return f"{supplied.current_a:.3f} A still flow"
