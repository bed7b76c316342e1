"""The wire: heat balance and phase transformation, lumped.

    (m c + m L dξ/dT) dT/dt = I² R(ξ) − h A (T − T_amb)        R = R_cold (1 + r ξ)        stroke · ξ = displacement

ξ, the austenite fraction, follows T through a Duhem model: its hysteresis is what the driver has to invert. Within a
substep dξ/dT and R are frozen and the balance is solved exactly; substeps of at most 10 ms and about 1 K keep the
error far below the sensors' noise.
"""

from __future__ import annotations

from math import expm1, inf

from firmware_sim.config import Transformation, Wire
from smadrive.hysteresis import DuhemModel

SUBSTEP_S = 0.01
SUBSTEP_K = 1.0


class Plant:
    """A wire that starts at ambient temperature, all martensite. `advance` moves it on; its failures are methods."""

    def __init__(self, wire: Wire, transformation: Transformation) -> None:
        self.wire = wire
        self.temperature_c = wire.ambient_c
        self.current_a = 0.0
        self._model = DuhemModel.gaussian(
            mu_heating=transformation.mu_heating_c,
            mu_cooling=transformation.mu_cooling_c,
            sigma_heating=transformation.sigma_heating_c,
            sigma_cooling=transformation.sigma_cooling_c,
            scale=wire.stroke_mm,
            input_range=transformation.range_c,
        )
        self._state = self._model.initial_state(wire.ambient_c)
        self._latent_j_per_mm = wire.mass_kg * wire.latent_heat_j_per_kg / wire.stroke_mm
        self._broken = False
        self._leak_a = 0.0

    @property
    def phase(self) -> float:
        """Austenite fraction ξ."""
        return self._state.w

    @property
    def displacement_mm(self) -> float:
        """Contraction of the wire."""
        return self._state.y

    @property
    def resistance_ohm(self) -> float:
        """R(ξ); infinite when the wire is broken."""
        return inf if self._broken else self._intact_ohm()

    def break_wire(self) -> None:
        """No current flows any more."""
        self._broken = True

    def short_switch(self, leak_a: float) -> None:
        """The board's switch fails: `leak_a` flows whatever the firmware wants."""
        self._leak_a = leak_a

    def mend(self) -> None:
        """Undo the failures."""
        self._broken = False
        self._leak_a = 0.0

    def advance(self, current_a: float, dt_s: float, voltage_max_v: float = inf) -> None:
        """Let `current_a` flow for `dt_s`, or as much of it as `voltage_max_v` drives."""
        driven_a = min(current_a, voltage_max_v / self._intact_ohm())
        self.current_a = 0.0 if self._broken else max(driven_a, self._leak_a)
        while dt_s > 1e-12:
            dt_s -= self._substep(dt_s)

    def _substep(self, remaining_s: float) -> float:
        wire = self.wire
        settled_c = wire.ambient_c + self.current_a**2 * self._intact_ohm() / wire.loss_w_per_k
        offset_c = settled_c - self.temperature_c
        slope_mm_per_k = self._model.slope(self._state, 1 if offset_c > 0 else -1)
        rate_per_s = wire.loss_w_per_k / (wire.heat_capacity_j_per_k + self._latent_j_per_mm * slope_mm_per_k)
        dt_s = min(remaining_s, SUBSTEP_S, SUBSTEP_K / (abs(offset_c) * rate_per_s + 1e-9))
        self.temperature_c -= offset_c * expm1(-dt_s * rate_per_s)
        self._state = self._model.step(self._state, self.temperature_c)
        return dt_s

    def _intact_ohm(self) -> float:
        return self.wire.resistance_cold_ohm * (1.0 + self.wire.resistance_change * self._state.w)
