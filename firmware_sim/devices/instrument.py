"""A measuring device: it shows temperature or displacement of the wire, as often as it converts, and heats nothing."""

from __future__ import annotations

from collections.abc import Mapping

from firmware_sim.devices.registers import Quantity
from firmware_sim.sensors.sensors import Sensors


class Instrument:
    """Shows what the sensors had to say at its last conversion, every `update_s`."""

    current_a = 0.0
    voltage_max_v = 0.0

    def __init__(self, sensors: Sensors, update_s: float) -> None:
        self._sensors = sensors
        self._update_s = update_s
        self.restart()

    def restart(self) -> None:
        """A power-up: convert at once."""
        self._since_s = 0.0
        self._shown = self._converted()

    def tick(self, dt_s: float) -> None:
        """Convert when it is time."""
        self._since_s += dt_s
        if self._since_s >= self._update_s - 1e-9:
            self.restart()

    def check(self, values: Mapping[str, float]) -> None:
        """Nothing that is written to it touches the wire."""

    def write(self, values: Mapping[str, float]) -> None:
        """Nothing that is written to it touches the wire."""

    def quantities(self) -> Mapping[str, Quantity]:
        """Temperature and displacement; None: no reading."""
        return self._shown

    def _converted(self) -> Mapping[str, Quantity]:
        return {
            "temperature": None if self._sensors.unreadable else self._sensors.temperature_c,
            "displacement": self._sensors.displacement_mm(),
        }
