"""The default reference of `demo` and `tune`: a slow sine over the middle of the wire's travel."""

from __future__ import annotations

from smadrive.control.references.reference import Reference
from smadrive.control.references.shapes import sine
from smadrive.wire.wire_model import Travel

LOW, HIGH = 0.2, 0.8
"""The ends of the sine, as shares of the travel from its cold end."""

PERIOD_S = 56.0
"""The period of the sine. It is the period of the published tracking records (0.0178 Hz)."""


def slow_sine(travel: Travel, cycles: float) -> Reference:
    """Return the sine for a wire with this travel."""
    return sine(low_mm=travel.at_mm(LOW), high_mm=travel.at_mm(HIGH), period_s=PERIOD_S, cycles=cycles)


def slow_sine_name(travel: Travel) -> str:
    """Return the name of the sine for users, such as `sine 2.4 to 9.6 mm, 56 s`."""
    return f"sine {travel.at_mm(LOW):.1f} to {travel.at_mm(HIGH):.1f} mm, {PERIOD_S:g} s"
