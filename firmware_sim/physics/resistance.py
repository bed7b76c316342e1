"""The resistance of the wire, from its temperature T, its austenite fraction ξ and its contraction.

    R = R_cold · g · [(1 - ξ) (1 + a_M ΔT) + ξ ρ (1 + a_A ΔT) (1 + h s(T))]          ΔT = T - T_reference

Martensite and austenite conduct in series, each with its temperature coefficient a_M or a_A. ρ is the ratio of their
resistivities. The factor g is the geometry of the strain: a wire that is stretched by ε at a constant volume is longer
by 1 + ε, and its cross section is smaller by 1 + ε, so its resistance grows by (1 + ε)². The cold wire is stretched by
the full strain ε_0, and g = ((1 + ε)/(1 + ε_0))². At the reference temperature the hot wire has R_cold (1 + r).

On cooling, austenite may turn into the R-phase before it turns into martensite. The R-phase hardly strains the wire,
but its resistivity is larger by the fraction h. The hysteresis of the R-phase, 1 to 2 K, is left out. So the share of
the austenite that is R-phase depends on the temperature alone: s(T) = Φ((T_R - T)/σ_R). A heated wire has almost no
austenite at such temperatures, so the hump appears on cooling only.

The vendor gives resistivities of about 76 (martensite) and 82 µΩ cm (austenite) for Flexinol; the values of other
vendors are 80 and 100 (SMA Inc., Memry). Together with the geometry of the strain, these resistivities hardly change
the resistance. Loaded Flexinol loses 10 to 15 % when it contracts, because stretched martensite has a larger
resistivity. So r is a parameter of its own. Song, Kubica and Gorbet (Resistance Modelling of SMA Wire Actuators, NDT in
Aerospace, Montreal 2011) show the effects of temperature and R-phase on the resistance of actuator wires. The
temperature coefficient of the austenite may even be negative in alloys with more nickel: Kakeshita et al., Jpn. J.
Appl. Phys. 37, 2535 (1998).
"""

from __future__ import annotations

from math import erfc, sqrt

from firmware_sim.config import Resistance, Wire

UNIFORM = Resistance()
"""A resistance that depends on the austenite fraction alone."""


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

        `phase` is the austenite fraction. `contraction` is the displacement as a share of the full stroke, from 0 for
        the stretched wire.
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
