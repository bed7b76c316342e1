"""Whether the heat has ended: the measured current must be gone, whatever a device says of itself."""

from __future__ import annotations

from math import isnan

from smadrive.clock import Clock
from smadrive.devices.heating.heat_source import HeatSource, Supplied
from smadrive.errors import DeviceError, ProtocolError, SafetyError, TransportError

CURRENT_ZERO_A = 0.05
"""Less than this is the noise of a current sense."""
ZERO_SHARE = 0.1
"""And no more than this part of current_max_a, for thin wires."""
CURRENT_GONE_S = 0.2
"""How long after switching off, beside the time in which the source settles, current may still be seen."""
LOOK_AGAIN_S = 0.05


def wait_for_zero_current(source: HeatSource, current_max_a: float, clock: Clock) -> Supplied:
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
