"""A bench supply: it holds current or voltage, whichever is reached first, and has no watchdog.

What makes it a hazard for a wire, and what a driver must make up for: it heats on when nobody talks to it any more, it
measures no temperature, and a failure of the wire shows only in its readings. Where its map has the registers `ovp` and
`ocp`, more voltage or current than that, set or measured, switches the output off and latches a protection, which is
reset by a write of 0 where its register can be written, and else at the panel or by a power-up.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import inf

from firmware_sim.devices.registers import Quantity
from firmware_sim.sensors.sensors import Sensors
from smadrive.devices.profile.profile import Profile

CC_MARGIN = 0.99
TRIP_MARGIN = 1.01  # beyond the noise of the measurement


class Supply:
    """Current limit, voltage limit and an output switch; starts with the output off and both at zero."""

    def __init__(self, sensors: Sensors, profile: Profile, log: Callable[[str], None]) -> None:
        """A `profile` without a voltage to command: the current alone decides."""
        self._sensors = sensors
        self._has_voltage = profile.roles.heater_voltage is not None
        self._log = log
        self.protections = {
            role: inf if (highest := profile.register(profile.role(role)).max) is None else highest
            for role in ("ovp", "ocp")
            if getattr(profile.roles, role) is not None
        }
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
        """A power-up: output off, nothing set, nothing latched; the protections stay as they were set."""
        self.set_a = 0.0
        self.set_v = 0.0
        self.on = False
        self.latched = "ok"

    def tick(self, _dt_s: float) -> None:
        """Let the protections look at what flows."""
        if self.on:
            self._protect(self._sensors.voltage_v / TRIP_MARGIN, self._sensors.current_a / TRIP_MARGIN)

    def check(self, values: Mapping[str, float]) -> None:
        """Whatever lies within the registers' limits can be set."""

    def write(self, values: Mapping[str, float]) -> None:
        """Set current, voltage, protections, output."""
        self.set_a = values.get("heater_current", self.set_a)
        self.set_v = values.get("heater_voltage", self.set_v)
        self.protections |= {name: values[name] for name in self.protections if name in values}
        if values.get("faults") == 0:
            self.latched = "ok"
        self._protect(self.set_v, self.set_a)
        self._switch(on=self.latched == "ok" and bool(values.get("heater_enable", self.on)))

    def quantities(self) -> Mapping[str, Quantity]:
        """What was set, what is measured, and which of the two limits holds."""
        return {
            "heater_current": self.set_a,
            "heater_voltage": self.set_v,
            "heater_enable": float(self.on),
            "measured_current": self._sensors.current_a,
            "measured_voltage": self._sensors.voltage_v,
            "regulation": self._regulation(),
            "faults": self.latched,
            **self.protections,
        }

    def _protect(self, voltage_v: float, current_a: float) -> None:
        for name, value in (("ovp", voltage_v), ("ocp", current_a)):
            if value > self.protections.get(name, inf) and self.latched == "ok":
                self.latched = name
                self._switch(on=False)
                self._log(f"{name}: {value:g} is more than {self.protections[name]:g}, output off")

    def _switch(self, *, on: bool) -> None:
        if on != self.on:
            self.on = on
            self._log("output on, no watchdog" if on else "output off")

    def _regulation(self) -> str:
        if not self.on:
            return "off"
        return "cc" if self._sensors.current_a >= CC_MARGIN * self.set_a else "cv"
