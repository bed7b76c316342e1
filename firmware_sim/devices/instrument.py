"""A measuring device. It shows the temperature and the displacement of the wire, if it has registers for them."""

from __future__ import annotations

from collections.abc import Mapping

from firmware_sim.devices.registers import Quantity
from firmware_sim.sensors.sensors import Sensors


class InstrumentFirmware:
    """Reads the sensors every `update_s`, and shows these readings until the next time. It does not heat."""

    current_a = 0.0
    voltage_max_v = 0.0

    def __init__(self, sensors: Sensors, update_s: float) -> None:
        self._sensors = sensors
        self._update_s = update_s
        self.restart()

    def restart(self) -> None:
        """Power up, and read the sensors at once."""
        self._since_s = 0.0
        self._shown = self._converted()

    def tick(self, dt_s: float) -> None:
        """Let `dt_s` pass. Read the sensors when `update_s` has passed since they were last read."""
        self._since_s += dt_s
        if self._since_s >= self._update_s - 1e-9:
            self.restart()

    def check(self, values: Mapping[str, float]) -> None:
        """Accept every write, because no register acts on the wire."""

    def write(self, values: Mapping[str, float]) -> None:
        """Ignore every write, because no register acts on the wire."""

    def quantities(self) -> Mapping[str, Quantity]:
        """Return temperature and displacement by role. None marks a missing reading."""
        return self._shown

    def _converted(self) -> Mapping[str, Quantity]:
        return {
            "temperature": None if self._sensors.unreadable else self._sensors.temperature_c,
            "displacement": self._sensors.displacement_mm(),
        }
