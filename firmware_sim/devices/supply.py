"""A bench supply. It limits current and voltage (some supplies only the current), and has no watchdog.

A supply is a hazard for a wire: it continues to heat when the driver is silent, it measures no temperature, and a
failure of the wire shows only in its readings. The driver must handle these hazards.

A supply with the roles `ovp` and `ocp` has protections. If the set or measured voltage is higher than `ovp`, or the set
or measured current is higher than `ocp`, the supply switches its output off and latches the protection. If the register
of the role `faults` is writable, a write of 0 to this register resets the protection. Otherwise only the panel or a
power-up resets the protection.

A supply keeps its setpoints over a power failure. If the register of the role `boot_power` holds 1, the supply then
also switches its output on. As delivered it holds 0.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import inf

from firmware_sim.devices.registers import Quantity
from firmware_sim.sensors.sensors import Sensors
from smadrive.devices.profile.profile import Profile

CC_MARGIN = 0.99
TRIP_MARGIN = 1.01  # a measured value may exceed a protection by this factor, because of noise


class SupplyFirmware:
    """A current limit, a voltage limit and an output switch.

    At the start the output is off, and both limits are zero.
    """

    def __init__(self, sensors: Sensors, profile: Profile, log_event: Callable[[str], None]) -> None:
        """Take the protections from `profile`. If the profile has no voltage command, only the current is limited."""
        self._sensors = sensors
        self._has_voltage = profile.roles.heater_voltage is not None
        self._log_event = log_event
        self.protections = {
            role: inf if (highest := profile.register(profile.role(role)).max) is None else highest
            for role in ("ovp", "ocp")
            if getattr(profile.roles, role) is not None
        }
        self.set_a = self.set_v = 0.0
        self.boots_on = False
        self.on = False
        self.latched = "ok"

    @property
    def current_a(self) -> float:
        """The current limit while the output is on, otherwise 0."""
        return self.set_a if self.on else 0.0

    @property
    def voltage_max_v(self) -> float:
        """The voltage limit; infinite for a supply without a voltage command."""
        return self.set_v if self._has_voltage else inf

    def restart(self) -> None:
        """Power up: no protection is latched, and setpoints and protection limits keep their values."""
        self.latched = "ok"
        self._switch(on=self.boots_on)

    def tick(self, _dt_s: float) -> None:
        """Check the measured voltage and current against the protections."""
        if self.on:
            self._protect(self._sensors.voltage_v / TRIP_MARGIN, self._sensors.current_a / TRIP_MARGIN)

    def check(self, values: Mapping[str, float]) -> None:
        """Accept every write, because the register bank has checked the limits of the registers."""

    def write(self, values: Mapping[str, float]) -> None:
        """Set current, voltage, protections and output. A role that `values` does not contain keeps its value."""
        self.set_a = values.get("heater_current", self.set_a)
        self.set_v = values.get("heater_voltage", self.set_v)
        self.boots_on = bool(values.get("boot_power", self.boots_on))
        self.protections |= {name: values[name] for name in self.protections if name in values}
        if values.get("faults") == 0:
            self.latched = "ok"
        self._protect(self.set_v, self.set_a)
        self._switch(on=self.latched == "ok" and bool(values.get("heater_enable", self.on)))

    def quantities(self) -> Mapping[str, Quantity]:
        """Return setpoints, measured values, the active limit (cc or cv), and the protections, by role."""
        return {
            "heater_current": self.set_a,
            "heater_voltage": self.set_v,
            "heater_enable": float(self.on),
            "measured_current": self._sensors.current_a,
            "measured_voltage": self._sensors.voltage_v,
            "regulation": self._regulation(),
            "faults": self.latched,
            "boot_power": float(self.boots_on),
            **self.protections,
        }

    def _protect(self, voltage_v: float, current_a: float) -> None:
        for name, value in (("ovp", voltage_v), ("ocp", current_a)):
            if value > self.protections.get(name, inf) and self.latched == "ok":
                self.latched = name
                self._switch(on=False)
                self._log_event(f"{name}: {value:g} is more than {self.protections[name]:g}, output off")

    def _switch(self, *, on: bool) -> None:
        if on != self.on:
            self.on = on
            self._log_event("output on, no watchdog" if on else "output off")

    def _regulation(self) -> str:
        if not self.on:
            return "off"
        return "cc" if self._sensors.current_a >= CC_MARGIN * self.set_a else "cv"
