"""The boiling point of water at an air pressure, for the calibration of a thermocouple.

Antoine's equation with the constants for 1 to 100 °C (Dortmund Data Bank): log10(p / mmHg) = A - B / (C + T / °C).
"""

from __future__ import annotations

from math import log10

STANDARD_HPA = 1013.25
_MMHG_PER_HPA = 0.750062
_A, _B, _C = 8.07131, 1730.63, 233.426


def boiling_point_c(pressure_hpa: float) -> float:
    """Return the boiling point of water in °C at the air pressure `pressure_hpa`; within 0.1 K for 500 to 1100 hPa."""
    return _B / (_A - log10(pressure_hpa * _MMHG_PER_HPA)) - _C
