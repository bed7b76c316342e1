"""The sensors on the wire, with lag, noise, quantisation and drift of the cold junction."""

from __future__ import annotations

from firmware_sim.config import SimConfig
from firmware_sim.physics.plant import Plant
from firmware_sim.sensors.bead import Bead
from firmware_sim.sensors.noise import Noise
from firmware_sim.sensors.sensor_faults import HEALTHY, SensorFaults


class Sensors:
    """The sensors on one plant, with the `bead` of the thermocouple and the `faults` of all sensors.

    The same seed gives the same noise.
    """

    def __init__(self, config: SimConfig, plant: Plant, seed: int) -> None:
        self.faults = SensorFaults(seed)
        thermocouple, sense, displacement = config.thermocouple, config.sense, config.displacement
        self._noise_c, self._quantum_c = thermocouple.noise_c, thermocouple.quantum_c
        self._conversion_s = thermocouple.conversion_s
        self._drift_c_per_h = thermocouple.cold_junction_drift_c_per_h
        self._noise_a, self._noise_v = sense.current_noise_a, sense.voltage_noise_v
        self._quantum_a, self._quantum_v = sense.current_quantum_a, sense.voltage_quantum_v
        self._noise_mm = None if displacement is None else displacement.noise_mm
        self._plant = plant
        self._noise = Noise(seed)
        self.bead = Bead(plant.temperature_c, thermocouple.lag_s)
        self._since_conversion_s = 0.0
        self._shown_mm = plant.displacement_mm
        self.conversions = 0
        self.cold_junction_c = thermocouple.cold_junction_c
        self.temperature_c = plant.temperature_c
        self._convert()
        self.current_a = 0.0
        self.voltage_v = 0.0

    @property
    def unreadable(self) -> str | None:
        """The thermocouple fault that the converter detects, "open" or "short". None if the converter detects no fault.

        While the converter detects a fault, it makes no reading: `temperature_c` keeps its last value.
        """
        name = self.faults.thermocouple.name
        return name if name in ("open", "short") else None

    @property
    def findings(self) -> list[str]:
        """The present faults that the hardware of a board detects, by name.

        open, short   fault of the thermocouple, as in `unreadable`
        pressed       the emergency stop is pressed
        silent        a sensor does not answer on its bus
        stuck         the current source does not answer
        """
        found = [] if self.unreadable is None else [self.unreadable]
        return found + [fault.name for fault in self.faults.hardware if fault.name != HEALTHY]

    def advance(self, wire_before_c: float, dt_s: float) -> None:
        """Update the readings after the plant advanced by `dt_s`, beginning at the wire temperature `wire_before_c`."""
        self.faults.advance(dt_s)
        self.bead.advance(wire_before_c, self._plant.temperature_c, self._plant.surroundings.ambient_c, dt_s)
        self.cold_junction_c += self._drift_c_per_h * dt_s / 3600
        self._since_conversion_s += dt_s
        stopped = self.faults.thermocouple.name == "stopped"
        if self._since_conversion_s >= self._conversion_s - 1e-9 and not stopped:
            self._since_conversion_s = 0.0
            self.conversions += 1
            self._convert()
        self._sense_heater()

    def displacement_mm(self) -> float | None:
        """Return a noisy sample of the displacement, or None if the bench has no displacement sensor."""
        if self._noise_mm is None:
            return None
        right_mm = self._plant.displacement_mm + self._noise_mm * self._noise.next()
        self._shown_mm = self.faults.displacement.shown(right_mm, self._shown_mm)
        return self._shown_mm

    def _convert(self) -> None:
        right_c = self.bead.temperature_c + self._noise_c * self._noise.next()
        shown_c = self.faults.thermocouple.shown(right_c, self.temperature_c, self.cold_junction_c)
        if self.unreadable is None:
            self.temperature_c = round(shown_c / self._quantum_c) * self._quantum_c

    def _sense_heater(self) -> None:
        right_a = max(0.0, self._plant.current_a + self._noise_a * self._noise.next())
        right_v = max(0.0, self._plant.voltage_v + self._noise_v * self._noise.next())
        self.current_a = self.faults.current.shown(_quantised(right_a, self._quantum_a), self.current_a)
        self.voltage_v = self.faults.voltage.shown(_quantised(right_v, self._quantum_v), self.voltage_v)


def _quantised(value: float, quantum: float) -> float:
    return value if quantum == 0.0 else round(value / quantum) * quantum
