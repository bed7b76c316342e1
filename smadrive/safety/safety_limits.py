"""The limits of a run that the supervisor checks."""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite, nan

from smadrive.measurement import Measurement

LEAST_SHARE = 0.5
"""A voltage limit of the device explains only a current above this share of the commanded current."""


@dataclass(frozen=True, slots=True)
class SafetyLimits:
    """Limits of a run, from the rig file.

    temperature_max_c     highest temperature of the wire, °C
    temperature_min_c     lowest reading of the thermocouple, °C
    current_max_a         largest current, A
    stale_after_s         longest time between two measurements, s
    current_tolerance_a   the measured current must lie between the smallest and the largest command of the last
                          `settle_s`, ± this value, A
    settle_s              longest time in which the heat source reaches a commanded current, s
    displacement_min_mm   lowest displacement, mm
    displacement_max_mm   highest displacement, mm
    tracking_max_mm       largest difference between setpoint and displacement, mm
    tracking_for_s        longest time for which the difference may exceed `tracking_max_mm`, s, and for which a
                          displacement with a limit may be unknown in a run
    contradicts_for_s     longest time for which displacement or resistance may contradict the reading, because the
                          thermocouple lags, s; the displacement may never be beyond the travel of the model
    displacement_fresh_s  greatest age of a displacement that still shows how hot the wire is, s
    """

    temperature_max_c: float
    temperature_min_c: float
    current_max_a: float
    stale_after_s: float
    current_tolerance_a: float
    settle_s: float
    displacement_min_mm: float
    displacement_max_mm: float
    tracking_max_mm: float
    tracking_for_s: float
    contradicts_for_s: float
    displacement_fresh_s: float

    @property
    def has_displacement(self) -> bool:
        """True if a limit needs the displacement."""
        return any(map(isfinite, (self.displacement_min_mm, self.displacement_max_mm, self.tracking_max_mm)))

    def without_old_displacement(self, measurement: Measurement) -> Measurement:
        """Return the measurement; its displacement is NaN if it is older than `displacement_fresh_s`, or its age NaN.

        The wire may have become hot since an old displacement was read.
        """
        if measurement.displacement_age_s <= self.displacement_fresh_s:
            return measurement
        return measurement._replace(displacement_mm=nan)

    def device_faults(self, measurement: Measurement) -> tuple[str, str | None]:
        """Return the latched faults of the device as text, and the limit of the rig that belongs to them.

        The limit is None for faults that have no limit in the rig file.
        """
        faults = ", ".join(measurement.device_faults)
        if "over_temperature" in measurement.device_faults:
            return f"{faults}: {measurement.temperature_c:.1f} °C", f"temperature_max_c = {self.temperature_max_c:g} °C"
        if "over_current" in measurement.device_faults:
            return f"{faults}: {measurement.current_a:.3f} A", f"current_max_a = {self.current_max_a:g} A"
        return faults, None


def excuses_less_than(measurement: Measurement, commanded_a: float) -> bool:
    """Return True if a limit of the device explains a current below `commanded_a`.

    A voltage limit alone explains only a current above `LEAST_SHARE` of `commanded_a`.
    """
    if measurement.device_limits == ("voltage",):
        return measurement.current_a > LEAST_SHARE * commanded_a
    return bool(measurement.device_limits)
