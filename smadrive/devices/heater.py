"""The only way to heat: every current above zero is commanded by `Heater.exchange`.

`Heater` joins a heat source with the sensors of the wire. It clamps the current to [0, current_max_a]. Over the
last `DERATE_C` below temperature_max_c, the upper limit falls linearly to zero. While a separate thermometer does not
answer, the upper limit is a current that cannot heat the wire above temperature_max_c. The current is zero while the
source is not armed, while the temperature is invalid or not below its maximum, and when the command is not finite.
`Heater.arm` also sets the limits and the watchdog in the source.
"""

from __future__ import annotations

from dataclasses import replace
from math import isfinite, nan

from smadrive.clock import Clock
from smadrive.devices.calibration import UNCORRECTED, Corrections
from smadrive.devices.guardian.client import GuardianClient
from smadrive.devices.heating.heat_source import HeaterLimits, HeatSource, Sample, Supplied
from smadrive.devices.heating.zero_current import confirm_off
from smadrive.devices.sensor import PolledSensor
from smadrive.devices.stopping.listener import StopListener
from smadrive.errors import ConfigError, ProtocolError, SafetyError, TakenOverError, UnknownCurrentError
from smadrive.measurement import Measurement

DERATE_C = 5.0
AT_LIMIT = 1.0 - 1e-6
"""A command of at least this fraction of the limit counts as limited: some controllers clamp to the limit, too."""
_NOTHING = Sample(nan, 0.0)


class Heater:
    """A heat source with the sensors of its wire. Methods raise the errors of the devices.

    thermometer     sensor that replaces the temperature of the source
    displacement    sensor that replaces the displacement of the source
    guard           guardian of a source that has no watchdog of its own
    stop            makes `exchange` raise StoppedError after a request to stop
    corrections     convert readings to values; the limits of this class apply to the corrected values
    from_source     quantities to take from the source; None takes all that the source measures. Leave out a quantity
                    whose input has no sensor: such an input shows a value, too
    """

    def __init__(
        self,
        source: HeatSource,
        limits: HeaterLimits,
        clock: Clock,
        thermometer: PolledSensor | None = None,
        displacement: PolledSensor | None = None,
        guard: GuardianClient | None = None,
        stop: StopListener | None = None,
        corrections: Corrections = UNCORRECTED,
        from_source: frozenset[str] | None = None,
    ) -> None:
        """Nothing is sent before `connect`. ConfigError when no device measures the temperature."""
        self._from_source = source.measures if from_source is None else from_source
        if thermometer is None and "temperature" not in self._from_source:
            raise ConfigError(
                "no device measures the temperature of the wire",
                where="[[devices]]",
                cure="add a thermometer to the rig file",
            )
        self.source = source
        self.limits = limits
        self._clock = clock
        self.thermometer = thermometer
        self.displacement = displacement
        self._guard = guard
        self._stop = stop
        self._corrections = corrections
        self._temperature_c = nan
        self._sent_a = 0.0

    @property
    def temperature_period_s(self) -> float:
        """Period in seconds of a separate thermometer; 0 when every exchange measures the temperature."""
        return 0.0 if self.thermometer is None else self.thermometer.period_s

    @property
    def has_temperature_limit(self) -> bool:
        """True if the heat source itself measures the temperature of the wire and switches off above its limit."""
        return self.thermometer is None and self.source.has_temperature_limit

    def connect(self) -> Measurement:
        """Prove the identity of every device, write its safe state, and return a measurement. Nothing is armed."""
        self.source.connect()
        for sensor in (self.thermometer, self.displacement):
            if sensor is not None:
                sensor.connect()
        if self._guard is not None:
            self._guard.configure(self.source.identity)
        return self.exchange(0.0)

    def arm(self, watchdog_s: float) -> None:
        """Set the limits and the watchdog of the source, confirmed by read-back, then arm it.

        SafetyError when a fault is latched, the temperature is invalid or too high, the guardian is gone, or the device
        does not arm. ConfigError when the device cannot keep the limits of the rig or this watchdog time.
        """
        now = self.exchange(0.0)
        if now.device_faults:
            raise SafetyError(
                "not armed, because faults are latched on the device",
                value=", ".join(now.device_faults),
                cure="remove the cause, then clear the faults",
            )
        if not self._temperature_c < self.limits.temperature_max_c:
            raise SafetyError(
                "not armed, because the temperature is unknown or too high",
                value=now.temperature_fault or f"{now.temperature_c:.1f} °C",
                limit=f"{self.limits.temperature_max_c:g} °C",
                cure="check the thermocouple, or let the wire cool down",
            )
        self.source.configure(self._source_limits(), watchdog_s)
        if self._guard is not None:
            self._guard.watch()
        self.source.arm()

    def exchange(self, current_a: float) -> Measurement:
        """Command `current_a`, clamped to the limits, and return the measurement.

        If the command is not finite, zero is sent and SafetyError is raised. After a wrong reply the temperature
        counts as unknown, so the next command is clamped to zero.
        """
        if self._stop is not None:
            self._stop.check()
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
            what, cure = "the commanded current is not finite, so zero was sent", "check the controller"
            raise SafetyError(what, where="current_a", value=current_a, cure=cure)
        return measurement

    def end_heat(self) -> None:
        """Command zero current once. A source that does not answer any more is sent its safe state before that.

        Call this only when `enter_safe_state` follows.
        """
        self.source.send_safe_state()
        self.exchange(0.0)

    def enter_safe_state(self) -> None:
        """Set zero current and switch the heater off, confirmed by read-back.

        This is tried several times. If the read-back never confirms it, the first error of the last try is raised;
        SafetyError when current still flows, or the source still reports that it is armed.
        """
        self._sent_a = 0.0
        if self._guard is None:
            self._switch_off()
        else:
            self._switch_off_under(self._guard)

    def clear_faults(self) -> Measurement:
        """Clear the latched faults and return a measurement; SafetyError names the faults that persist.

        The heater is in its safe state afterwards.
        """
        try:
            self.enter_safe_state()
        except UnknownCurrentError:  # a latched fault may be the reason
            self.source.clear_faults()
            self.enter_safe_state()
        self.source.clear_faults()
        measurement = self.exchange(0.0)
        if measurement.device_faults:
            what, value = "not cleared, because their cause persists", ", ".join(measurement.device_faults)
            raise SafetyError(what, where="faults", value=value, cure="remove the cause first")
        return measurement

    def _switch_off(self) -> None:
        """Switch off, confirmed by read-back, and wait until no current flows."""
        confirm_off(self.source, self.limits.current_max_a, self._clock)

    def _switch_off_under(self, guard: GuardianClient) -> None:
        """Switch off. The guardian watches until no current flows, and switches off if the driver stands still.

        If the driver cannot switch off, it hands over to the guardian. When that has finished, the driver tries again.
        """
        while True:
            guard.take_back()
            try:
                self._switch_off()
            except TakenOverError:
                continue
            except Exception:
                if not guard.hand_over():
                    raise
                continue
            guard.stand_down()
            return

    def _source_limits(self) -> HeaterLimits:
        """Return the limits for the source, which compares them with its own uncorrected readings.

        The temperature limit for the source is its reading at `temperature_max_c`, but at most `temperature_max_c`.
        """
        most_c = self.limits.temperature_max_c
        return replace(self.limits, temperature_max_c=min(most_c, self._corrections.temperature.reading_at(most_c)))

    def _allowed(self, current_a: float) -> tuple[float, tuple[str, ...]]:
        """Return the allowed current in amperes, and the names of the limits that lower it."""
        headroom_c = self.limits.temperature_max_c - self._temperature_c
        if not (self.source.armed and isfinite(current_a)):
            return 0.0, ()
        if not headroom_c > 0.0:  # the wire is too hot, or its temperature is unknown (NaN)
            return 0.0, ("temperature",) if current_a > 0.0 else ()
        most_a, limit = self.limits.current_max_a, "current_max"
        if self.thermometer is not None and self.thermometer.failure and self.limits.holding_a < most_a:
            most_a, limit = self.limits.holding_a, "temperature"
        if headroom_c < DERATE_C:
            most_a *= headroom_c / DERATE_C
            limit = "temperature"
        return min(max(current_a, 0.0), most_a), (limit,) if current_a >= AT_LIMIT * most_a else ()

    def _measurement(self, supplied: Supplied, in_force_a: float, limits: tuple[str, ...]) -> Measurement:
        temperature = self._sample("temperature", supplied.temperature, self.thermometer)
        displacement = self._sample("displacement", supplied.displacement, self.displacement)
        now_s = self._clock.now_s()
        self._temperature_c = self._corrections.temperature.corrected(temperature.value)
        return Measurement(
            time_s=now_s,
            temperature_c=self._temperature_c,
            current_a=supplied.current_a,
            voltage_v=supplied.voltage_v,
            displacement_mm=self._corrections.displacement.corrected(displacement.value),
            temperature_fault=temperature.problem,
            device_faults=supplied.faults,
            device_limits=supplied.limits,
            host_limits=limits,
            armed=supplied.armed
            and self.source.armed,  # a source that switched on again by itself does not count as armed
            in_force_a=in_force_a if supplied.setting_a is None else supplied.setting_a,
            temperature_age_s=now_s - temperature.time_s,
            displacement_age_s=now_s - displacement.time_s,
            supply_fault=supplied.problem,
        )

    def _sample(self, quantity: str, supplied: Sample | None, sensor: PolledSensor | None) -> Sample:
        if sensor is not None:
            return sensor.sample(heats=self.source.armed)
        return supplied if supplied is not None and quantity in self._from_source else _NOTHING
