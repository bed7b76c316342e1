"""The resistance of a wire in its data sheet, compared with the alloy and with the measured resistance.

**Alloy.** A wire of diameter d with the resistance R' per metre has the resistivity rho = R' π d² / 4. Nickel-titanium
has about 0.8 µΩ·m, copper-based shape-memory alloys have about 0.1 µΩ·m, copper itself has 0.017 µΩ·m. A resistivity
outside `RESISTIVITIES_UOHM_M` is a mistyped number.

**Measurement.** The measured resistance includes leads and clamps. It differs from the data sheet by some tenths, not
by `RESISTANCE_FACTOR`.
"""

from __future__ import annotations

from math import pi

from smadrive.wire.heat_balance import HeatBalance

RESISTIVITIES_UOHM_M = (0.03, 5.0)
"""Lowest and highest resistivity of a wire in µΩ·m."""

RESISTANCE_FACTOR = 1.5
"""Largest factor, up or down, between the measured resistance and the data sheet."""

LEADS_OHM = 0.5
"""Resistance of leads and clamps in ohms. It matters for a short thick wire."""


def resistivity_uohm_m(diameter_mm: float, resistance_ohm_per_m: float) -> float:
    """Return the resistivity in µΩ·m. A cross-section in mm² is 1e-6 of that in m²."""
    return resistance_ohm_per_m * 0.25 * pi * diameter_mm**2


def resistance_caveats(measured_ohm: float, nominal: HeatBalance) -> tuple[str, ...]:
    """Return a reason to distrust the nominal heat balance, from the data sheet, or nothing. NaN is no reason."""
    ends_ohm = nominal.resistance_ohm(0.0), nominal.resistance_ohm(1.0)
    low_ohm, high_ohm = min(ends_ohm) / RESISTANCE_FACTOR, RESISTANCE_FACTOR * (max(ends_ohm) + LEADS_OHM)
    if not (measured_ohm < low_ohm or measured_ohm > high_ohm):
        return ()
    limits = f"{low_ohm:.3g} to {high_ohm:.3g} Ω are possible"
    found = f"the measured resistance is {measured_ohm:.3g} Ω, and the wire file gives {ends_ohm[0]:.3g} Ω ({limits})"
    return (f"{found}: check resistance_ohm_per_m, length_mm and the clamps",)
