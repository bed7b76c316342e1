"""The resistance of the wire, from its temperature T, its austenite fraction ξ and its contraction.

    R = R_cold · g · [(1 - ξ) (1 + a_M ΔT) + ξ ρ (1 + a_A ΔT) (1 + h s(T))]          ΔT = T - T_reference

Martensite and austenite conduct in series, each with its temperature coefficient a_M or a_A. ρ is the ratio of their
resistivities, and T_reference the ambient temperature of the config. The factor g is the effect of the strain ε on the
geometry. At a constant volume, the strain multiplies the length of the wire by 1 + ε and divides the cross section by
1 + ε, so it multiplies the resistance by (1 + ε)². The cold wire has the full strain ε_0, so g = ((1 + ε)/(1 + ε_0))².
A wire of austenite (ξ = 1, ε = 0) has the resistance R_cold (1 + r) at the reference temperature; r is the
`resistance_change` of the config.

On cooling, austenite may turn into the R-phase before it turns into martensite. The R-phase hardly strains the wire,
but its resistivity is larger by the fraction h. The hysteresis of the R-phase, 1 to 2 K, is left out. So the share of
the austenite that is R-phase depends on the temperature alone: s(T) = Φ((T_R - T)/σ_R), Φ being the normal distribution
function. During heating the wire has almost no austenite at such temperatures. So the R-phase raises the resistance
only during cooling.

For Flexinol the vendor gives resistivities of about 76 (martensite) and 82 µΩ cm (austenite). For other wires the
vendors give 80 and 100 µΩ cm (SMA Inc., Memry). With these resistivities and the factor g, the resistance would hardly
change when the wire contracts. But loaded Flexinol then loses 10 to 15 % of its resistance, because stretched
martensite has a larger resistivity. So r is a parameter of its own. Song, Kubica and Gorbet (Resistance Modelling of
SMA Wire Actuators, NDT in Aerospace, Montreal 2011) show the effects of temperature and R-phase on the resistance of
actuator wires. In alloys with more nickel, the temperature coefficient of the austenite may even be negative: Kakeshita
et al., Jpn. J. Appl. Phys. 37, 2535 (1998).
"""

from __future__ import annotations

from math import erfc, sqrt

from firmware_sim.config import Resistance, Wire

UNIFORM = Resistance()
"""The parameters of a resistance that depends on the austenite fraction alone."""


class WireResistance:
    """The resistance of one wire. Without `dependence` it depends on the austenite fraction alone."""

    def __init__(self, wire: Wire, dependence: Resistance | None) -> None:
        dependence = dependence or UNIFORM
        self._cold_ohm, self._reference_c = wire.resistance_cold_ohm, wire.ambient_c
        self._strain = dependence.strain
        stretched = (1.0 + dependence.strain) ** 2
        self._change = wire.resistance_change + (1.0 + wire.resistance_change) * (stretched - 1.0)
        self._martensite_per_k, self._austenite_per_k = dependence.martensite_per_k, dependence.austenite_per_k
        self._r_phase = dependence.r_phase

    def ohm(self, temperature_c: float, phase: float, contraction: float) -> float:
        """Return the resistance in Ω.

        `phase` is the austenite fraction. `contraction` is the displacement as a share of the full stroke: 0 for the
        stretched wire, 1 for the fully contracted wire.
        """
        warmer_k = temperature_c - self._reference_c
        geometry = (1.0 - self._strain * contraction / (1.0 + self._strain)) ** 2
        martensite = (1.0 - phase) * self._martensite_per_k * warmer_k
        per_austenite = (1.0 + self._austenite_per_k * warmer_k) * (1.0 + self._hump(temperature_c)) - 1.0
        austenite = phase * (1.0 + self._change) * per_austenite
        return self._cold_ohm * geometry * (1.0 + self._change * phase + martensite + austenite)

    def _hump(self, temperature_c: float) -> float:
        """Return the relative change of the austenite's resistivity by the R-phase in it."""
        if self._r_phase is None:
            return 0.0
        above = (temperature_c - self._r_phase.centre_c) / self._r_phase.sigma_c
        return self._r_phase.rise * 0.5 * erfc(above / sqrt(2.0))
