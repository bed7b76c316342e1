"""The limits of the runs in these tests."""

from math import inf

from smadrive.safety.safety_limits import SafetyLimits

LIMITS = SafetyLimits(
    temperature_max_c=120.0,
    temperature_min_c=-20.0,
    current_max_a=inf,
    stale_after_s=0.3,
    current_tolerance_a=0.05,
    settle_s=0.0,
    displacement_min_mm=-inf,
    displacement_max_mm=inf,
    tracking_max_mm=inf,
    tracking_for_s=2.0,
    contradicts_for_s=3.5,
    displacement_fresh_s=0.5,
)
