"""What the board measures of the wire: lag, noise, quantisation, drift, and the ways in which a thermocouple fails."""

from __future__ import annotations

from math import exp
from random import Random
from typing import Literal

from firmware_sim.config import SimConfig
from firmware_sim.plant import Plant

Failure = Literal["none", "open", "short", "frozen", "stopped"]


class Sensors:
    """The sensors on one plant. The same seed gives the same noise."""

    def __init__(self, config: SimConfig, plant: Plant, seed: int) -> None:
        self._thermocouple = config.thermocouple
        self._sense = config.sense
        self._displacement = config.displacement
        self._plant = plant
        self._random = Random(seed)
        self._bead_c = plant.temperature_c
        self._since_conversion_s = 0.0
        self._failure: Failure = "none"
        self.conversions = 0
        self.temperature_c = self._converted()
        self.cold_junction_c = config.thermocouple.cold_junction_c
        self.current_a = 0.0
        self.voltage_v = 0.0

    @property
    def failure(self) -> Failure:
        """What is wrong with the thermocouple; the converter reports "open" and "short", the others show in no bit."""
        return self._failure

    def open_thermocouple(self) -> None:
        """A wire of the thermocouple breaks."""
        self._failure = "open"

    def short_thermocouple(self) -> None:
        """The thermocouple touches the supply or ground."""
        self._failure = "short"

    def freeze_thermocouple(self) -> None:
        """The converter goes on counting and repeats its last value."""
        self._failure = "frozen"

    def stop_conversions(self) -> None:
        """The converter hangs: neither value nor count changes."""
        self._failure = "stopped"

    def mend_thermocouple(self) -> None:
        """Undo the failure."""
        self._failure = "none"

    def advance(self, wire_before_c: float, dt_s: float) -> None:
        """Follow the plant, which has just moved on by `dt_s` from `wire_before_c`."""
        self._lag(wire_before_c, self._plant.temperature_c, dt_s)
        self.cold_junction_c += self._thermocouple.cold_junction_drift_c_per_h * dt_s / 3600
        self._since_conversion_s += dt_s
        if self._since_conversion_s >= self._thermocouple.conversion_s - 1e-9 and self._failure != "stopped":
            self._since_conversion_s = 0.0
            self.conversions += 1
            if self._failure != "frozen":
                self.temperature_c = self._converted()
        self._sense_heater()

    def displacement_mm(self) -> float | None:
        """A noisy sample of the displacement; None when no sensor is fitted."""
        if self._displacement is None:
            return None
        return self._plant.displacement_mm + self._random.gauss(0.0, self._displacement.noise_mm)

    def _lag(self, before_c: float, after_c: float, dt_s: float) -> None:
        """First-order lag behind a wire that moves linearly from before to after (exact)."""
        lag_s = self._thermocouple.lag_s
        if lag_s == 0.0:
            self._bead_c = after_c
            return
        decay = exp(-dt_s / lag_s)
        steady_c = after_c - before_c - (after_c - before_c) * lag_s / dt_s * (1.0 - decay)
        self._bead_c = before_c + steady_c + (self._bead_c - before_c) * decay

    def _converted(self) -> float:
        noisy_c = self._bead_c + self._random.gauss(0.0, self._thermocouple.noise_c)
        return round(noisy_c / self._thermocouple.quantum_c) * self._thermocouple.quantum_c

    def _sense_heater(self) -> None:
        current_a, resistance_ohm = self._plant.current_a, self._plant.resistance_ohm
        voltage_v = current_a * resistance_ohm if current_a > 0 else 0.0
        self.current_a = max(0.0, current_a + self._random.gauss(0.0, self._sense.current_noise_a))
        self.voltage_v = max(0.0, voltage_v + self._random.gauss(0.0, self._sense.voltage_noise_v))
