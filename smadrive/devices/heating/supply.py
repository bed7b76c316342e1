"""A bench supply as heat source, with current limit, voltage limit and output switch.

A supply has no watchdog, measures no temperature and answers slowly. A user can also change its current setting at the
front panel. So every exchange first reads the setting back, together with the measurements that belong to it. A setting
that differs from the previous command is an error. The voltage limit of the rig file is set once, and every exchange
reads it back, too: when a wire comes off its clamps, the voltage of the supply rises to this limit.
"""

from __future__ import annotations

from math import inf, isfinite

from smadrive.devices.device import Device
from smadrive.devices.heating.device_source import DeviceSource
from smadrive.devices.heating.heat_source import HeaterLimits, Supplied
from smadrive.devices.profile.readings import RegisterReading, problem_of
from smadrive.errors import ConfigError, ReadBackError, SafetyError

_NEEDED = ("heater_current", "heater_enable", "measured_current", "measured_voltage")
_OPTIONAL = ("heater_voltage", "regulation", "faults")

AT_LIMIT = 0.98
"""A supply without a CC/CV flag counts as limiting the voltage from this fraction of the voltage limit on."""

PROTECTION = 1.1
"""The supply's own protections are set to this factor times the limits of the rig, if the registers allow that."""


class BenchSupply(DeviceSource[Device]):
    """A bench supply as heat source, with the interface HeatSource.

    The profile of the device names the register of each role, such as heater_current. ConfigError when the profile
    names no register for a role that every supply needs.
    """

    measures: frozenset[str] = frozenset()
    has_watchdog = False
    has_temperature_limit = False

    def __init__(self, device: Device, answers_within_s: float = inf) -> None:
        """Nothing is sent yet.

        While the supply is armed, `exchange` begins no retry and no quarantine that a silent supply would prolong
        beyond `answers_within_s` after its last answer: meanwhile current flows, and nothing is checked.
        """
        super().__init__(device)
        profile = device.profile
        self._names = {role: profile.role(role) for role in _NEEDED}
        for role in _OPTIONAL:
            if (name := getattr(profile.roles, role)) is not None:
                self._names[role] = name
        self._reads = tuple(self._names.values())
        self._measured = self._names["measured_current"], self._names["measured_voltage"]
        self._answers_within_s = answers_within_s
        self._answered_s = -inf
        self._voltage_max_v = inf
        self._voltage_set: RegisterReading | None = None

    def configure(self, limits: HeaterLimits, watchdog_s: float) -> None:  # noqa: ARG002  (a supply has no watchdog)
        """Prove the identity again, then set protections, voltage limit and zero current, confirmed by read-back.

        The output is also set to stay off after a power failure, if the profile has the role `boot_power`. ConfigError
        when the supply cannot command `current_max_a`.
        """
        self.device.check_identity()
        self._check_current_max(limits.current_max_a)
        if (boot_power := self.device.profile.roles.boot_power) is not None:
            self.device.write(boot_power, 0)
        self._protect("ocp", limits.current_max_a)
        self._limit_voltage(limits.voltage_max_v)
        self.device.write(self._names["heater_current"], 0.0)

    def arm(self) -> None:
        """Switch the output on; SafetyError when it stays off."""
        self.device.write(self._names["heater_enable"], 1)
        if not self._on(self.device.read(self._reads, proved=True)):
            raise SafetyError(
                "not armed, because the output of the supply stays off",
                where=f"unit {self.device.unit_id}",
                cure="check that the supply is not locked and that no protection has tripped",
            )
        self._armed, self._answered_s = True, self.device.clock.now_s()

    def exchange(self, current_a: float, *, proved: bool = False) -> Supplied:
        """Measure while the previous current is in force, then set `current_a`, and return the measured values.

        ReadBackError when the current setting is not that of the previous command, or when the voltage limit has
        changed.
        """
        answers_by_s = self._answered_s + self._answers_within_s if self._armed else inf
        within_s = answers_by_s - self.device.clock.now_s()
        name = self._names["heater_current"]
        readings = self.device.command(name, current_a, self._reads, proved=proved, within_s=within_s)
        self._answered_s = self.device.clock.now_s()
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
            setting_a=readings[name].value,
        )

    def forget_command(self) -> None:
        """Forget the last command, so that the next exchange sends its command even if it is the same."""
        self.device.forget_command(self._names["heater_current"])

    def enter_safe_state(self) -> None:
        """Set zero current and switch the output off, confirmed by read-back.

        The voltage limit is not checked any more until `configure` has set it again.
        """
        self._voltage_set = None
        super().enter_safe_state()

    def clear_faults(self) -> None:
        """Reset a tripped protection if its register can be written. Other supplies are reset at their panel."""
        name = self._names.get("faults")
        if name is not None and self.device.profile.register(name).writable:
            self.device.write(name, 0)

    def _check_current_max(self, limit_a: float) -> None:
        highest_a = self.device.profile.register(self._names["heater_current"]).max
        if highest_a is not None and limit_a > highest_a:
            raise ConfigError(
                f"is more than '{self.device.profile.profile.id}' can supply",
                where="current_max_a",
                value=f"{limit_a:g} A",
                limit=f"{highest_a:g} A",
                cure="lower current_max_a in [limits]",
            )

    def _limit_voltage(self, limit_v: float) -> None:
        """Set the voltage limit. ConfigError when the limit is missing, or when the supply cannot have one."""
        profile, is_limited = self.device.profile, isfinite(limit_v)
        name = self._names.get("heater_voltage")
        if name is None and is_limited:
            raise ConfigError(
                f"cannot be set, because '{profile.profile.id}' has no register for heater_voltage",
                where="voltage_max_v",
                value=f"{limit_v:g} V",
                cure="add heater_voltage to [roles], or set the limit at the supply and leave voltage_max_v out",
            )
        if name is not None and not is_limited:
            raise ConfigError(
                f"is missing, but '{profile.profile.id}' needs a voltage limit",
                where="voltage_max_v",
                cure="set voltage_max_v in [limits] to about 1.25 times the voltage of the wire at current_max_a",
            )
        if name is not None:
            self._protect("ovp", limit_v)
            self.device.write(name, limit_v)
            self._voltage_max_v = limit_v
            self._voltage_set = self.device.read((name,))[name]

    def _check_voltage_limit(self, readings: dict[str, RegisterReading]) -> None:
        """Raise ReadBackError if the voltage limit has changed since it was set."""
        if self._voltage_set is None:
            return
        name = self._names["heater_voltage"]
        if readings[name].raw != self._voltage_set.raw:
            raise ReadBackError(
                "the voltage limit reads back another value than the one that was set",
                where=f"unit {self.device.unit_id}, register '{name}'",
                value=f"{readings[name].value:g} V, set to {self._voltage_set.value:g} V",
                cure="check that the knob of the supply was not turned",
            )

    def _protect(self, role: str, limit: float) -> None:
        """Set the protection `role` (ovp or ocp) of the supply above the limit, if the profile has this role."""
        name = getattr(self.device.profile.roles, role)
        if name is not None:
            highest = self.device.profile.register(name).max
            self.device.write(name, min(PROTECTION * limit, inf if highest is None else highest))

    def _on(self, readings: dict[str, RegisterReading]) -> bool:
        return readings[self._names["heater_enable"]].raw == 1

    def _faults(self, readings: dict[str, RegisterReading]) -> tuple[str, ...]:
        """Return the names of the protections that have switched the output off; return an empty tuple if none has."""
        name = self._names.get("faults")
        if name is None or not readings[name].raw:
            return ()
        return readings[name].words or (f"protection {readings[name].raw}",)

    def _limits_voltage(self, readings: dict[str, RegisterReading], voltage_v: float) -> bool:
        """Return True if the supply limits its voltage (CV) instead of its current (CC).

        The CC/CV flag shows this. Without such a flag, a voltage near the limit shows it.
        """
        name = self._names.get("regulation")
        return "cv" in readings[name].words if name is not None else voltage_v >= AT_LIMIT * self._voltage_max_v
