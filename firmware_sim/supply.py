"""A bench supply: it holds current or voltage, whichever is reached first, and has no watchdog.

What makes it a hazard for a wire, and what a driver must make up for: it heats on when nobody talks to it any more, it
measures no temperature, and a failure of the wire shows only in its readings.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import inf

from firmware_sim.registers import Quantity
from firmware_sim.sensors import Sensors

CC_MARGIN = 0.99


class Supply:
    """Current limit, voltage limit and an output switch; starts with the output off and both at zero."""

    def __init__(self, sensors: Sensors, *, has_voltage: bool, log: Callable[[str], None]) -> None:
        """`has_voltage`: the map commands a voltage; without it, the current alone decides."""
        self._sensors = sensors
        self._has_voltage = has_voltage
        self._log = log
        self.restart()

    @property
    def current_a(self) -> float:
        """The current limit while the output is on."""
        return self.set_a if self.on else 0.0

    @property
    def voltage_max_v(self) -> float:
        """The voltage limit."""
        return self.set_v if self._has_voltage else inf

    def restart(self) -> None:
        """A power-up: output off, nothing set."""
        self.set_a = 0.0
        self.set_v = 0.0
        self.on = False

    def tick(self, dt_s: float) -> None:
        """Nothing in a supply depends on time."""

    def check(self, values: Mapping[str, float]) -> None:
        """Whatever lies within the registers' limits can be set."""

    def write(self, values: Mapping[str, float]) -> None:
        """Set current, voltage, output."""
        self.set_a = values.get("heater_current", self.set_a)
        self.set_v = values.get("heater_voltage", self.set_v)
        on = bool(values.get("heater_enable", self.on))
        if on != self.on:
            self.on = on
            self._log("output on, no watchdog" if on else "output off")

    def quantities(self) -> Mapping[str, Quantity]:
        """What was set, what is measured, and which of the two limits holds."""
        return {
            "heater_current": self.set_a,
            "heater_voltage": self.set_v,
            "heater_enable": float(self.on),
            "measured_current": self._sensors.current_a,
            "measured_voltage": self._sensors.voltage_v,
            "regulation": self._regulation(),
        }

    def _regulation(self) -> str:
        if not self.on:
            return "off"
        return "cc" if self._sensors.current_a >= CC_MARGIN * self.set_a else "cv"
