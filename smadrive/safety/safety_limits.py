"""The limits of a run that the supervisor checks."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, isfinite

from smadrive.measurement import Measurement


@dataclass(frozen=True, slots=True)
class SafetyLimits:
    """Limits of a run, from the rig file.

    The longest time between two measurements is `stale_after_s`. The heat source needs up to `settle_s` to reach a
    commanded current: the measured current must lie between the smallest and the largest command of the last
    `settle_s`, ± `current_tolerance_a`. The displacement may be outside the band of the model for up to
    `misplaced_for_s`, because the thermocouple lags, but not beyond the travel of the model. It may be unknown, or
    differ from the setpoint by more than `tracking_max_mm`, for up to `tracking_for_s`.
    """

    temperature_max_c: float
    temperature_min_c: float = -20.0
    current_max_a: float = inf
    stale_after_s: float = 0.3
    current_tolerance_a: float = 0.05
    settle_s: float = 0.0
    displacement_min_mm: float = -inf
    displacement_max_mm: float = inf
    tracking_max_mm: float = inf
    tracking_for_s: float = 2.0
    misplaced_for_s: float = 2.0

    @property
    def has_displacement(self) -> bool:
        """True if a limit needs the displacement."""
        return any(map(isfinite, (self.displacement_min_mm, self.displacement_max_mm, self.tracking_max_mm)))

    def device_faults(self, measurement: Measurement) -> tuple[str, str | None]:
        """Return the latched faults of the device, and the limit of the rig that the measurement has exceeded.

        The limit is None for faults without such a limit.
        """
        faults = ", ".join(measurement.device_faults)
        if "over_temperature" in measurement.device_faults:
            return f"{faults}: {measurement.temperature_c:.1f} °C", f"temperature_max_c = {self.temperature_max_c:g} °C"
        if "over_current" in measurement.device_faults:
            return f"{faults}: {measurement.current_a:.3f} A", f"current_max_a = {self.current_max_a:g} A"
        return faults, None
