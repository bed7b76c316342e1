"""The only way to heat: every ampere goes through `Heater.exchange`.

It joins a heat source with the sensors of the wire and clamps the current: to [0, current_max_a], to a falling limit
within `DERATE_C` of temperature_max_c, and to zero while the source is not armed, the temperature is invalid or at its
maximum, or the command is not a number. Arming sets the limits and the watchdog of the source itself.
"""

from __future__ import annotations

from math import isfinite, nan

from smadrive.clock import Clock
from smadrive.devices.guardian.client import GuardianClient
from smadrive.devices.heating.heat_source import HeaterLimits, HeatSource, Sample, Supplied
from smadrive.devices.heating.zero_current import wait_for_zero_current
from smadrive.devices.sensor import PolledSensor
from smadrive.errors import ConfigError, ProtocolError, SafetyError, TakenOverError
from smadrive.measurement import Measurement

DERATE_C = 5.0
AT_LIMIT = 1.0 - 1e-6
"""A command above this part of the limit counts as limited: a controller that knows the limit commands no more."""
_NOTHING = Sample(nan, 0.0)


class Heater:
    """A heat source with the sensors of its wire; raises the errors of the devices.

    `thermometer` and `displacement` replace the measurements of the source; ConfigError when nothing measures the
    temperature. `guard` is the guardian of a source that has no watchdog of its own.
    """

    def __init__(
        self,
        source: HeatSource,
        limits: HeaterLimits,
        clock: Clock,
        thermometer: PolledSensor | None = None,
        displacement: PolledSensor | None = None,
        guard: GuardianClient | None = None,
    ) -> None:
        """Nothing is sent yet; call `connect()`."""
        if thermometer is None and "temperature" not in source.measures:
            raise ConfigError(
                "no device measures the temperature of the wire", where="[[devices]]", cure="add one to the rig file"
            )
        self.source = source
        self.limits = limits
        self._clock = clock
        self._thermometer = thermometer
        self._displacement = displacement
        self._guard = guard
        self._temperature_c = nan
        self._sent_a = 0.0

    @property
    def armed(self) -> bool:
        """Whether the source was armed at every exchange since `arm`."""
        return self.source.armed

    @property
    def temperature_period_s(self) -> float:
        """The period of the thermometer, where a device of its own measures the temperature; 0: every exchange."""
        return 0.0 if self._thermometer is None else self._thermometer.period_s

    def connect(self) -> Measurement:
        """Prove the identity of every device, bring it to its safe state, and measure. Nothing is armed afterwards."""
        self.source.connect()
        for sensor in (self._thermometer, self._displacement):
            if sensor is not None:
                sensor.connect()
        if self._guard is not None:
            self._guard.configure(self.source.identity)
        return self.exchange(0.0)

    def arm(self, watchdog_s: float) -> None:
        """Give the source its limits and its watchdog, confirmed by read-back, then arm it.

        SafetyError when a fault is latched, the temperature is invalid or too high, or the device does not arm;
        ConfigError when the device cannot have such a watchdog or limit.
        """
        now = self.exchange(0.0)
        if now.device_faults:
            raise SafetyError(
                "not armed, faults are latched on the device",
                value=", ".join(now.device_faults),
                cure="remove the cause, then clear the faults",
            )
        if not self._temperature_c < self.limits.temperature_max_c:
            raise SafetyError(
                "not armed, the temperature does not allow it",
                value=now.temperature_fault or f"{now.temperature_c:.1f} °C",
                limit=f"{self.limits.temperature_max_c:g} °C",
            )
        self.source.configure(self.limits, watchdog_s)
        if self._guard is not None:
            self._guard.watch()
        self.source.arm()

    def exchange(self, current_a: float) -> Measurement:
        """Command `current_a`, clamped to the limits, and measure.

        A current that is not a number is sent as zero, then SafetyError is raised. After a wrong reply the temperature
        counts as unknown, and the next command is clamped to zero.
        """
        if self._guard is not None:
            self._guard.check()
        allowed_a, limits = self._allowed(current_a)
        in_force_a, self._sent_a = self._sent_a, allowed_a
        try:
            supplied = self.source.exchange(allowed_a)
        except ProtocolError:
            self._temperature_c = nan
            raise
        measurement = self._measurement(supplied, in_force_a, limits)
        if not isfinite(current_a):
            raise SafetyError(
                "the commanded current is not a number, zero was sent",
                where="current_a",
                value=current_a,
                cure="check the controller",
            )
        return measurement

    def disarm(self) -> Measurement:
        """Enter the safe state and measure."""
        self.enter_safe_state()
        return self.exchange(0.0)

    def enter_safe_state(self) -> None:
        """Zero current and heater off, confirmed by read-back; tried several times, raises when unconfirmed.

        SafetyError when current still flows, or the source still reports that it is armed.
        """
        self._sent_a = 0.0
        if self._guard is None:
            self._switch_off()
        else:
            self._switch_off_under(self._guard)

    def clear_faults(self) -> Measurement:
        """Clear the latched faults; SafetyError names those that persist. Nothing is armed afterwards."""
        self.enter_safe_state()
        self.source.clear_faults()
        measurement = self.exchange(0.0)
        if measurement.device_faults:
            raise SafetyError("not cleared, the cause persists", value=", ".join(measurement.device_faults))
        return measurement

    def _switch_off(self) -> None:
        """Switch off, confirmed by read-back, and wait until no current flows."""
        self.source.enter_safe_state()
        wait_for_zero_current(self.source, self.limits.current_max_a, self._clock)

    def _switch_off_under(self, guard: GuardianClient) -> None:
        """Switch off; the guardian watches until no current flows, and switches off if the driver stands still."""
        while True:
            guard.take_back()
            try:
                self._switch_off()
            except TakenOverError:
                continue
            guard.stand_down()
            return

    def _allowed(self, current_a: float) -> tuple[float, tuple[str, ...]]:
        """The current that may flow, and the names of the limits that hold it."""
        headroom_c = self.limits.temperature_max_c - self._temperature_c
        if not (self.source.armed and isfinite(current_a)):
            return 0.0, ()
        if not headroom_c > 0.0:  # too hot, or the temperature unknown
            return 0.0, ("temperature",) if current_a > 0.0 else ()
        most_a = self.limits.current_max_a
        limit = "current_max"
        if headroom_c < DERATE_C:
            most_a *= headroom_c / DERATE_C
            limit = "temperature"
        return min(max(current_a, 0.0), most_a), (limit,) if current_a >= AT_LIMIT * most_a else ()

    def _measurement(self, supplied: Supplied, in_force_a: float, limits: tuple[str, ...]) -> Measurement:
        temperature = supplied.temperature if self._thermometer is None else self._thermometer.sample()
        displacement = supplied.displacement if self._displacement is None else self._displacement.sample()
        temperature = temperature or _NOTHING
        displacement = displacement or _NOTHING
        now_s = self._clock.now_s()
        self._temperature_c = temperature.value
        return Measurement(
            time_s=now_s,
            temperature_c=temperature.value,
            current_a=supplied.current_a,
            voltage_v=supplied.voltage_v,
            displacement_mm=displacement.value,
            temperature_fault=temperature.problem,
            device_faults=supplied.faults,
            device_limits=supplied.limits,
            host_limits=limits,
            armed=supplied.armed
            and self.source.armed,  # a source that came on again is not armed: nothing would be sent
            in_force_a=in_force_a,
            temperature_age_s=now_s - temperature.time_s,
            displacement_age_s=now_s - displacement.time_s,
            supply_fault=supplied.problem,
        )
