"""The wire as a lumped model: heat balance and phase transformation.

    (m c + m L dξ/dT) dT/dt = I² R(T, ξ) - h A (T - T_amb)        stroke · ξ = displacement

m c is the heat capacity, L the latent heat, T the wire temperature, I the current, h A the heat loss per kelvin, and R
the resistance (resistance.py). The austenite fraction ξ follows T with a hysteresis (transformation.py). Within a
substep dξ/dT and R are taken as constant, and the balance is solved exactly. Substeps of at most 10 ms and about 1 K
keep the error far below the sensors' noise.
"""

from __future__ import annotations

from collections.abc import Callable
from math import expm1, inf

from firmware_sim.config import SimConfig
from firmware_sim.physics.ageing import Ageing
from firmware_sim.physics.heater_faults import HeaterFaults
from firmware_sim.physics.load import Load
from firmware_sim.physics.resistance import WireResistance
from firmware_sim.physics.surroundings import Surroundings
from firmware_sim.physics.transformation import LoadedTransformation

SUBSTEP_S = 0.01
SUBSTEP_K = 1.0


class Plant:
    """A wire that starts at ambient temperature, all martensite.

    `faults` are the faults of the heater circuit. `surroundings`, `load` and `ageing` can change during the simulation.
    """

    def __init__(self, config: SimConfig) -> None:
        wire = config.wire
        self.temperature_c = wire.ambient_c
        self.current_a = 0.0
        self.voltage_v = 0.0
        self.faults = HeaterFaults()
        self.ageing, self.load = Ageing(), Load()
        self.surroundings = Surroundings(wire.ambient_c, wire.loss_w_per_k)
        self._transformation = LoadedTransformation(config.transformation, config.bias, wire.stroke_mm, wire.ambient_c)
        self._heat_capacity_j_per_k = wire.heat_capacity_j_per_k
        self._latent_j = wire.mass_kg * wire.latent_heat_j_per_kg
        self._resistance = WireResistance(wire, config.resistance)
        self._lead_ohm = config.sense.lead_ohm
        self._stroke_mm = wire.stroke_mm
        self.resistance_ohm = self._resistance_ohm()
        """Resistance of the wire, without leads and contacts."""

    @property
    def phase(self) -> float:
        """Austenite fraction ξ."""
        return self._transformation.phase

    @property
    def displacement_mm(self) -> float:
        """Contraction of the wire, mm."""
        return self._stroke_mm * (1.0 - self.ageing.fade) * self._transformation.phase

    @property
    def loop_ohm(self) -> float:
        """Resistance of the heater circuit: wire, leads and contacts."""
        return self.resistance_ohm + self._lead_ohm + self.faults.circuit.contact_ohm

    def faults_by_name(self) -> dict[str, Callable[..., None]]:
        """Return the methods that a fault script can call, by name."""
        return self.faults.by_name() | self.surroundings.by_name() | self.load.by_name() | self.ageing.by_name()

    def _resistance_ohm(self) -> float:
        contraction = (1.0 - self.ageing.fade) * self._transformation.phase
        return self._resistance.ohm(self.temperature_c, self._transformation.phase, contraction)

    def advance(self, current_a: float, dt_s: float, voltage_max_v: float = inf) -> None:
        """Let the set current `current_a` flow for `dt_s`. If it needs more than `voltage_max_v`, less current flows.

        Faults of the heater circuit change the current, too.
        """
        self.faults.advance(dt_s)
        self.ageing.advance(dt_s)
        self._drive(current_a, voltage_max_v)
        while dt_s > 1e-12:
            dt_s -= self._substep(dt_s)

    def _drive(self, set_a: float, voltage_max_v: float) -> None:
        """Set the current, and the voltage at the source.

        If the wire is broken, no current flows. While the set current is not 0, the source then has its highest
        voltage, or 0 if `voltage_max_v` is infinite.
        """
        circuit = self.faults.circuit
        if circuit.broken:
            self.current_a, self.voltage_v = 0.0, voltage_max_v if set_a > 0.0 and voltage_max_v < inf else 0.0
            return
        loop_ohm = self.loop_ohm
        driven_a = min(set_a * circuit.passed, voltage_max_v / loop_ohm, circuit.voltage_max_v / loop_ohm)
        self.current_a = max(driven_a, circuit.leak_a)
        self.voltage_v = self.current_a * loop_ohm

    def _substep(self, remaining_s: float) -> float:
        loss_w_per_k = self.surroundings.loss_w_per_k
        settled_c = self.surroundings.ambient_c + self.current_a**2 * self.resistance_ohm / loss_w_per_k
        offset_c = settled_c - self.temperature_c
        slope_per_k = self._transformation.slope(rising=offset_c > 0)
        rate_per_s = loss_w_per_k / (self._heat_capacity_j_per_k + self._latent_j * slope_per_k)
        dt_s = min(remaining_s, SUBSTEP_S, SUBSTEP_K / (abs(offset_c) * rate_per_s + 1e-9))
        self.surroundings.advance(dt_s)
        self.temperature_c -= offset_c * expm1(-dt_s * rate_per_s)
        self._transformation.move_to(self.temperature_c - self.ageing.shift_c)
        if change_mpa := self.load.advance(dt_s):
            latent_k = self._latent_j / self._heat_capacity_j_per_k
            self.temperature_c += self._transformation.change_stress(change_mpa, latent_k)
        self.resistance_ohm = self._resistance_ohm()
        return dt_s
