"""The supervisor: checks every measurement, is independent of the controller, and can always stop the run.

The supervisor latches the first fault. It debounces conditions that noise can cause: these become a fault only when
several of the latest samples show them. For the limits of temperature and displacement, and for a frozen thermometer,
only new readings are samples: a slow sensor shows a wrong one in several ticks. A missing displacement or current
counts neither way, so a sensor that reads only now and then is still checked. Late, wrong and missing data are faults,
too. Compared with temperature, heat or resistance, an old displacement counts as not measured.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from math import inf, isfinite, nan

from smadrive.measurement import Measurement
from smadrive.safety.arming_checks import check_cooled, check_may_arm
from smadrive.safety.debounce import Debounce, Persistence, Renewal, Renewed
from smadrive.safety.displacement_band import DisplacementBand
from smadrive.safety.faults import Contradiction, Fault, Trip
from smadrive.safety.resistance_band import ResistanceBand
from smadrive.safety.safety_limits import SafetyLimits, excuses_less_than
from smadrive.safety.temperature_band import FROZEN_C, UNBOUNDED, UNFOLLOWED_C, AtLeast, Heated, TemperatureBand
from smadrive.safety.temperature_by_resistance import TemperatureByResistance, always

LATE_TICKS = 20
"""This number of missed deadlines in a row is a fault."""


class Supervisor:
    """Checks each measurement, and the time since the last measurement; the first fault is latched as `trip`.

    `temperature_band` compares the reading with the heat input, `displacement_band` the displacement with the model of
    the wire, and `resistance_band` the resistance with the last runs of the wire. A band that is None is not checked.
    While no sensor shows the displacement, `by_resistance` replaces it in the checks of the thermocouple; while the
    resistance is the source of the displacement, both check it. While `trusts_sensor` returns False, the displacement
    counts as not measured.
    """

    def __init__(
        self,
        limits: SafetyLimits,
        temperature_band: TemperatureBand | None = None,
        displacement_band: DisplacementBand | None = None,
        resistance_band: ResistanceBand | None = None,
        by_resistance: TemperatureByResistance | None = None,
        trusts_sensor: Callable[[], bool] = always,
    ) -> None:
        self._limits = limits
        self._temperature_band = temperature_band
        self._displacement_band = displacement_band
        self._resistance_band = resistance_band
        self._by_resistance = by_resistance
        self._trusts_sensor = trusts_sensor
        self.trip: Trip | None = None
        self._hot, self._overheated, self._frozen = Debounce(2, 3), Debounce(2, 3), Debounce(2, 3)
        self._cold, self._invalid, self._powerless = Debounce(3, 5), Debounce(3, 5), Debounce(3, 5)
        self._power_w = 0.0
        self._disarmed, self._mismatch = Debounce(2, 2), Debounce(4, 5)
        self._renewal, self._renewed = Renewal(), Renewed(temperature=True, displacement=True)
        self._implausible, self._beyond_travel = Debounce(3, 4), Debounce(3, 4)
        self._strayed = Debounce(3, 5)
        self._commands: deque[tuple[float, float]] = deque()
        self._fresh_s: float | None = None
        self._not_following, self._displacement_unknown = Persistence(), Persistence()
        self._contradicting = Persistence(), Persistence()
        self._late_ticks = 0

    def update(self, measurement: Measurement, setpoint_mm: float) -> Trip | None:
        """Check one measurement, and return the latched trip or None. `setpoint_mm` is NaN without a reference."""
        if not self._trusts_sensor():
            measurement = measurement._replace(displacement_mm=nan)
        self.check_fresh(measurement.time_s)
        self._fresh_s, self._renewed = measurement.time_s, self._renewal.update(measurement)
        if self._by_resistance is not None:
            self._by_resistance.update(measurement)
        self._check_device(measurement)
        self._check_temperature(measurement)
        self._check_current(measurement)
        self._check_power(measurement)
        fresh = self._limits.without_old_displacement(measurement)
        contradictions = self._contradictions(fresh)
        self._check_temperature_band(fresh, is_contradicted=any(contradictions))
        self._check_displacement(measurement, setpoint_mm)
        self._check_contradictions(fresh, contradictions)
        self._check_resistance_band(fresh)
        return self.trip

    def check_fresh(self, now_s: float) -> Trip | None:
        """Check the time since the last measurement, and return the latched trip or None."""
        if self._fresh_s is None:
            self._fresh_s = now_s
        age_s = now_s - self._fresh_s
        if age_s > self._limits.stale_after_s:
            limit = f"{self._limits.stale_after_s:g} s"
            self._raise(Fault.STALE_DATA, now_s, f"{age_s:.2f} s without a measurement", limit)
        return self.trip

    def check_deadline(self, missed: bool, now_s: float) -> Trip | None:
        """Count missed deadlines in a row, and return the trip or None. `missed`: this tick missed its deadline."""
        self._late_ticks = self._late_ticks + 1 if missed else 0
        if self._late_ticks >= LATE_TICKS:
            self._raise(Fault.DEADLINES_MISSED, now_s, f"{self._late_ticks} in a row")
        return self.trip

    def check_may_arm(self, measurement: Measurement) -> None:
        """Raise SafetyError when heating must not begin; call this only while the wire is at rest.

        arming_checks.py has the reasons. If heating may begin, the temperature band starts at the measured temperature.
        """
        check_may_arm(measurement, self._limits, next(filter(None, self._contradictions(measurement)), None))
        if self._temperature_band is not None:
            least_c = self._temperature_band.start(measurement.temperature_c, measurement.time_s)
            if not self._is_cool(self._limits.without_old_displacement(measurement), inf):
                check_cooled(measurement, least_c)

    @property
    def heated(self) -> Heated | None:
        """The possible wires now, for the supervisor of the next run. None if the heat input is not checked."""
        return None if self._temperature_band is None else self._temperature_band.heated

    def _check_device(self, measurement: Measurement) -> None:
        if measurement.device_faults:
            self._raise(Fault.DEVICE_FAULT, measurement.time_s, *self._limits.device_faults(measurement))
        elif self._disarmed.update(not measurement.armed):
            self._raise(Fault.DISARMED, measurement.time_s, "its output is off")

    def _check_temperature(self, measurement: Measurement) -> None:
        temperature_c, limits = measurement.temperature_c, self._limits
        if self._invalid.update(not isfinite(temperature_c)):
            self._raise(Fault.SENSOR_INVALID, measurement.time_s, measurement.temperature_fault or "no reading")
        if self._hot.update(temperature_c > limits.temperature_max_c if self._renewed.temperature else None):
            limit = f"{limits.temperature_max_c:g} °C"
            self._raise(Fault.OVER_TEMPERATURE, measurement.time_s, f"{temperature_c:.1f} °C", limit)
        if self._cold.update(temperature_c < limits.temperature_min_c if self._renewed.temperature else None):
            limit = f"{limits.temperature_min_c:g} °C"
            self._raise(Fault.UNDER_TEMPERATURE, measurement.time_s, f"{temperature_c:.1f} °C", limit)

    def _check_current(self, measurement: Measurement) -> None:
        """Compare the measured current with the commands of the last `settle_s`."""
        tolerance_a, measured_a = self._limits.current_tolerance_a, measurement.current_a
        if not self._commands:
            self._commands.append((measurement.time_s - 1e-9, 0.0))  # before the first command the current is zero
        self._commands.append((measurement.time_s, measurement.in_force_a))
        while self._commands[0][0] < measurement.time_s - self._limits.settle_s:
            self._commands.popleft()
        commanded_a = [command_a for _, command_a in self._commands]
        least_a, most_a = min(commanded_a), max(commanded_a)
        lacking = measured_a < least_a - tolerance_a and not excuses_less_than(measurement, least_a)
        if isfinite(measured_a) and self._mismatch.update(measured_a > most_a + tolerance_a or lacking):
            fault = Fault.CURRENT_MISMATCH if most_a > 0 else Fault.UNEXPECTED_HEATING
            detail = f"{measured_a:.3f} A measured, {least_a:.3f} to {most_a:.3f} A commanded"
            self._raise(fault, measurement.time_s, detail, f"± {tolerance_a:.2g} A")

    def _check_power(self, measurement: Measurement) -> None:
        """Compute the power from current and voltage. If one of them is unknown, keep the previous power."""
        power_w = measurement.current_a * measurement.voltage_v
        if is_known := isfinite(power_w):
            self._power_w = power_w
        if self._powerless.update(not is_known):
            self._raise(Fault.POWER_UNKNOWN, measurement.time_s, measurement.supply_fault or "no reading")

    def _check_temperature_band(self, measurement: Measurement, *, is_contradicted: bool) -> None:
        if self._temperature_band is None:
            return
        reading_c = measurement.temperature_c
        at_least = UNBOUNDED if is_contradicted else self._at_least(measurement)
        band = self._temperature_band.update(reading_c, self._power_w, measurement.time_s, at_least)
        is_hot = band.coldest_c > self._limits.temperature_max_c
        is_too_cold = reading_c < band.low_c or band.unfollowed_c > UNFOLLOWED_C
        if (is_hot or is_too_cold) and not is_contradicted and self._is_cool(measurement, band.hottest_c):
            is_hot = is_too_cold = False
        if self._overheated.update(is_hot):
            detail = f"at least {band.coldest_c:.0f} °C by the heat input, the thermocouple reads {reading_c:.1f} °C"
            self._raise(Fault.OVER_TEMPERATURE, measurement.time_s, detail, f"{self._limits.temperature_max_c:g} °C")
        if self._frozen.update(band.unseen_c > FROZEN_C if self._renewed.temperature else None):
            detail = f"{reading_c:.2f} °C, while the wire's temperature changed by at least {band.unseen_c:.0f} K"
            self._raise(Fault.SENSOR_FROZEN, measurement.time_s, detail)
        if self._implausible.update(is_too_cold or (isfinite(reading_c) and not reading_c <= band.high_c)):
            fault = Fault.READS_TOO_COLD if is_too_cold else Fault.READS_TOO_HOT
            detail = f"{reading_c:.1f} °C read, {band.low_c:.0f} to {band.high_c:.0f} °C are possible"
            self._raise(fault, measurement.time_s, detail)

    def _at_least(self, measurement: Measurement) -> AtLeast:
        """Return the lowest possible temperature and phase by the displacement, or else by the resistance."""
        if not isfinite(measurement.displacement_mm):
            return UNBOUNDED if self._by_resistance is None else self._by_resistance.at_least()
        band = self._displacement_band
        return UNBOUNDED if band is None else band.at_least(measurement.displacement_mm)

    def _is_cool(self, measurement: Measurement, hottest_c: float) -> bool:
        """Return True if the measured displacement, or else the resistance, excludes a wire above `temperature_max_c`.

        `hottest_c` is the greatest possible temperature of the wire by its heat input, °C. A reading below the
        temperature band is then right if it belongs to the displacement: a draft cools the wire.
        """
        if not isfinite(measurement.displacement_mm):
            return self._by_resistance is not None and self._by_resistance.excludes_limit(hottest_c)
        if self._displacement_band is None:
            return False
        return self._displacement_band.hottest_c(measurement.displacement_mm) <= self._limits.temperature_max_c

    def _check_displacement(self, measurement: Measurement, setpoint_mm: float) -> None:
        limits, measured_mm = self._limits, measurement.displacement_mm
        unknown_s = self._displacement_unknown.update(measurement.time_s, not isfinite(measured_mm))
        if limits.has_displacement and unknown_s > limits.tracking_for_s:
            self._raise(Fault.DISPLACEMENT_UNKNOWN, measurement.time_s, f"no reading for {limits.tracking_for_s:g} s")
        outside = measured_mm < limits.displacement_min_mm or measured_mm > limits.displacement_max_mm
        if isfinite(measured_mm) and self._strayed.update(outside if self._renewed.displacement else None):
            is_low = measured_mm < limits.displacement_min_mm
            limit = f"{limits.displacement_min_mm if is_low else limits.displacement_max_mm:g} mm"
            self._raise(Fault.OVER_DISPLACEMENT, measurement.time_s, f"{measured_mm:.3f} mm", limit)
        is_far = abs(setpoint_mm - measured_mm) > limits.tracking_max_mm if isfinite(measured_mm) else None
        if self._not_following.update(measurement.time_s, is_far) > limits.tracking_for_s:
            detail = f"setpoint {setpoint_mm:.3f} mm, measured {measured_mm:.3f} mm, for {limits.tracking_for_s:g} s"
            self._raise(Fault.TRACKING_LOST, measurement.time_s, detail, f"{limits.tracking_max_mm:g} mm")

    def _check_contradictions(
        self, measurement: Measurement, contradictions: tuple[Contradiction | None, Contradiction | None]
    ) -> None:
        """Trip at once if the displacement is impossible at every temperature, else if a contradiction lasts."""
        band, displacement_mm = self._displacement_band, measurement.displacement_mm
        is_beyond = None if band is None or not self._renewed.displacement else band.is_beyond_travel(displacement_mm)
        is_impossible = isfinite(displacement_mm) and self._beyond_travel.update(is_beyond)
        has_resistance = self._by_resistance is not None and self._by_resistance.is_measured
        compared = isfinite(displacement_mm), has_resistance
        for contradiction, is_compared, persistence in zip(contradictions, compared, self._contradicting, strict=True):
            holds = contradiction is not None if is_compared and isfinite(measurement.temperature_c) else None
            lasted_s = persistence.update(measurement.time_s, holds)
            if contradiction is not None and (is_impossible or lasted_s > self._limits.contradicts_for_s):
                self._raise(contradiction.fault, measurement.time_s, contradiction.detail)

    def _check_resistance_band(self, measurement: Measurement) -> None:
        if self._resistance_band is not None and (jump := self._resistance_band.jumped(measurement)):
            self._raise(Fault.RESISTANCE_JUMPED, measurement.time_s, *jump.texts())

    def _contradictions(self, measurement: Measurement) -> tuple[Contradiction | None, Contradiction | None]:
        """Return how displacement and resistance contradict the reading of the thermocouple; None if one does not."""
        read = measurement.temperature_c, measurement.displacement_mm
        by_displacement = None if self._displacement_band is None else self._displacement_band.outside(*read)
        by_resistance = None if self._by_resistance is None else self._by_resistance.outside(*read)
        return (
            None if by_displacement is None else Contradiction(Fault.DISPLACEMENT_IMPLAUSIBLE, by_displacement),
            None if by_resistance is None else Contradiction(Fault.RESISTANCE_IMPLAUSIBLE, by_resistance),
        )

    def _raise(self, fault: Fault, time_s: float, detail: str, limit: str | None = None) -> None:
        if self.trip is None:
            self.trip = Trip(fault, time_s, detail, limit)
