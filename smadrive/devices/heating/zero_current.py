"""The proof that heating has ended: the measured current is zero, and the device does not report that it is armed."""

from __future__ import annotations

from math import isnan

from smadrive.clock import Clock
from smadrive.devices.heating.heat_source import HeatSource, Supplied
from smadrive.errors import DeviceError, ProtocolError, SafetyError, TransportError, UnknownCurrentError

CURRENT_ZERO_A = 0.05
"""A measured current up to this value, in A, is noise of the measurement, so it counts as zero."""
ZERO_SHARE = 0.1
"""For thin wires, only a current up to this fraction of current_max_a counts as zero, if that is the smaller bound."""
CURRENT_GONE_S = 0.2
"""After switching off, current may flow for this time in seconds, plus the settling time of the source."""
LOOK_AGAIN_S = 0.05


def confirm_off(source: HeatSource, current_max_a: float, clock: Clock) -> Supplied:
    """Switch `source` off, wait until no current flows, and return its last measurements. Raises what both steps raise.

    The identity is proved within the repeated steps of the safe state: a check before them would give up after one
    damaged reply, with the heater on.
    """
    source.enter_safe_state()
    return wait_for_zero_current(source, current_max_a, clock)


def wait_for_zero_current(source: HeatSource, current_max_a: float, clock: Clock) -> Supplied:
    """Wait until no current flows from `source`, and return its last measurements.

    `source` must be in its safe state. SafetyError when current still flows after the allowed time, or the source still
    reports that it is armed; UnknownCurrentError when it does not measure the current. If the exchange fails then,
    raise the error of the exchange.
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
        flows = not abs(supplied.current_a) <= min(CURRENT_ZERO_A, ZERO_SHARE * current_max_a)
        if not (flows or supplied.armed):
            return supplied
        if clock.now_s() >= give_up_s:
            raise _error_of(supplied)
        clock.sleep_until(clock.now_s() + LOOK_AGAIN_S)


def _error_of(supplied: Supplied) -> SafetyError:
    """Return the error that names why `supplied` does not prove that heating has ended."""
    if supplied.armed:
        return _not_ended("the device reports that it is armed")
    if isnan(supplied.current_a):
        return UnknownCurrentError(
            "the heater was switched off, but its current is unknown",
            value=supplied.problem or "no reading",
            cure="cut the supply of the heater, and mend the measurement of the current. A board keeps the fault "
            "'sensor_bus' until it is cleared",
        )
    return _not_ended(f"{supplied.current_a:.3f} A")


def _not_ended(value: str) -> SafetyError:
    what = "the heater was switched off, but heating has not ended"
    return SafetyError(what, value=value, cure="cut the supply of the heater")
