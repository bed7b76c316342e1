"""A bench supply as heat source: current limit, voltage limit, output switch.

A supply has no watchdog, measures no temperature and answers slowly; its current is a setting that anyone may also turn
at its front panel. So every exchange begins by reading the setting back, together with the measurements that belong to
it, and a setting that is not the commanded one is an error. Its voltage limit is given by the rig, and read back as
well: with a wire that comes off its clamps a supply goes to that voltage.
"""

from __future__ import annotations

from math import inf, isfinite

from smadrive.devices.device import Device
from smadrive.devices.heating.heat_source import HeaterLimits, Supplied
from smadrive.devices.identity import Identity
from smadrive.devices.profile.readings import RegisterReading, problem_of
from smadrive.errors import ConfigError, ReadBackError, SafetyError

_NEEDED = ("heater_current", "heater_enable", "measured_current", "measured_voltage")
_OPTIONAL = ("heater_voltage", "regulation", "faults")

AT_LIMIT = 0.98
"""Part of the voltage limit from which a supply without a CC/CV flag is taken to hold the voltage."""

PROTECTION = 1.1
"""How far above the limits of the rig the supply's own protections are set."""


class BenchSupply:
    """A Device whose profile binds the roles of a supply; see HeatSource. ConfigError when it lacks one."""

    measures: frozenset[str] = frozenset()
    has_watchdog = False

    def __init__(self, device: Device) -> None:
        """Nothing is sent yet."""
        profile = device.profile
        self.device = device
        self.settle_s = profile.timing.settle_ms / 1e3
        self._names = {role: profile.role(role) for role in _NEEDED}
        for role in _OPTIONAL:
            if (name := getattr(profile.roles, role)) is not None:
                self._names[role] = name
        self._reads = tuple(self._names.values())
        self._measured = self._names["measured_current"], self._names["measured_voltage"]
        self._armed = False
        self._voltage_max_v = inf
        self._voltage_set: RegisterReading | None = None

    @property
    def identity(self) -> Identity:
        """See HeatSource."""
        return self.device.identity

    @property
    def armed(self) -> bool:
        """Whether the output was on at every exchange since `arm`."""
        return self._armed

    def connect(self) -> None:
        """Prove the supply's identity and switch its output off."""
        self.device.check_identity()
        self.enter_safe_state()

    def configure(self, limits: HeaterLimits, watchdog_s: float) -> None:  # noqa: ARG002  (a supply has no watchdog)
        """Set the protections, the voltage limit and zero current, confirmed by read-back."""
        self._protect("ocp", limits.current_max_a)
        self._limit_voltage(limits.voltage_max_v)
        self.device.write(self._names["heater_current"], 0.0)

    def arm(self) -> None:
        """Switch the output on; SafetyError when it stays off."""
        self.device.write(self._names["heater_enable"], 1)
        if not self._on(self.device.read(self._reads, proved=True)):
            raise SafetyError("not armed: the supply's output stays off: is it locked or in a protection?")
        self._armed = True

    def exchange(self, current_a: float, *, proved: bool = False) -> Supplied:
        """Measure what came of the limit in force, then set the next; ReadBackError when it is not what was set."""
        readings = self.device.command(self._names["heater_current"], current_a, self._reads, proved=proved)
        self._check_voltage_limit(readings)
        on = self._on(readings)
        self._armed = self._armed and on
        voltage_v = readings[self._names["measured_voltage"]].value
        return Supplied(
            readings[self._names["measured_current"]].value,
            voltage_v,
            on,
            self._faults(readings),
            ("voltage",) if on and self._limits_voltage(readings, voltage_v) else (),
            problem=problem_of(readings, self._measured),
        )

    def enter_safe_state(self) -> None:
        """See HeatSource."""
        self._armed = False
        self._voltage_set = None
        self.device.enter_safe_state()

    def clear_faults(self) -> None:
        """Reset the protection where the supply lets it be written; others are reset at their panel."""
        name = self._names.get("faults")
        if name is not None and self.device.profile.register(name).writable:
            self.device.write(name, 0)

    def _limit_voltage(self, limit_v: float) -> None:
        """ConfigError when a supply that can be limited is given no limit, or one that cannot is given one."""
        profile, is_limited = self.device.profile, isfinite(limit_v)
        name = self._names.get("heater_voltage")
        if name is None and is_limited:
            raise ConfigError(
                f"'{profile.profile.id}' binds no heater_voltage, so that voltage_max_v = {limit_v:g} would limit "
                "nothing: bind it in [roles], or set the limit at the supply and leave voltage_max_v out"
            )
        if name is not None and not is_limited:
            raise ConfigError(
                f"'{profile.profile.id}' needs a voltage limit: set voltage_max_v in [limits], some 1.25 times what "
                "current_max_a needs across the wire"
            )
        if name is not None:
            self._protect("ovp", limit_v)
            self.device.write(name, limit_v)
            self._voltage_max_v = limit_v
            self._voltage_set = self.device.read((name,))[name]

    def _check_voltage_limit(self, readings: dict[str, RegisterReading]) -> None:
        """ReadBackError when somebody changed it since it was set."""
        if self._voltage_set is None:
            return
        name = self._names["heater_voltage"]
        if readings[name].raw != self._voltage_set.raw:
            raise ReadBackError(
                f"unit {self.device.unit_id}, register '{name}': the voltage limit was set to "
                f"{self._voltage_set.value:g} V, reads back {readings[name].value:g} V: did somebody turn its knob?"
            )

    def _protect(self, role: str, limit: float) -> None:
        """Let the supply itself switch off above the limit, where it can."""
        name = getattr(self.device.profile.roles, role)
        if name is not None:
            highest = self.device.profile.register(name).max
            self.device.write(name, min(PROTECTION * limit, inf if highest is None else highest))

    def _on(self, readings: dict[str, RegisterReading]) -> bool:
        return readings[self._names["heater_enable"]].raw == 1

    def _faults(self, readings: dict[str, RegisterReading]) -> tuple[str, ...]:
        """The protection that has cut in; raw 0 is a supply at rest."""
        name = self._names.get("faults")
        if name is None or not readings[name].raw:
            return ()
        return readings[name].words or (f"protection {readings[name].raw}",)

    def _limits_voltage(self, readings: dict[str, RegisterReading], voltage_v: float) -> bool:
        """Whether it holds the voltage, not the current: it says so, or it stands at its limit."""
        name = self._names.get("regulation")
        return "cv" in readings[name].words if name is not None else voltage_v >= AT_LIMIT * self._voltage_max_v
