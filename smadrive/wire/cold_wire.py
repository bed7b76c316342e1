"""The reading of an unheated wire, compared with the ambient temperature of the wire file.

A wire cannot be colder than its surroundings, and an unheated wire is not warmer for long. A larger difference means
that the calibration of the thermocouple is wrong, or `ambient_c` of the wire file. The reading of a thermocouple with a
wrong calibration may be far too low; then the wire is hotter than the temperature limits allow.
"""

from __future__ import annotations

COLD_WIRE_K = 10.0
"""Largest difference in K: an uncalibrated thermocouple is wrong by up to 5 K, and a room differs by as much."""

CHECK_CALIBRATION = "calibrate the thermocouple again, or correct ambient_c in the wire file"


def is_too_cold(temperature_c: float, ambient_c: float) -> bool:
    """Return True if a wire at `ambient_c` cannot have this temperature; False for NaN."""
    return temperature_c < ambient_c - COLD_WIRE_K


def cold_wire_caveats(temperature_c: float, ambient_c: float) -> tuple[str, ...]:
    """Return a caveat if the unheated wire reads too far from the ambient temperature, else nothing; none for NaN."""
    if is_too_cold(temperature_c, ambient_c):
        cure = f"{CHECK_CALIBRATION}, before the wire is heated"
    elif temperature_c > ambient_c + COLD_WIRE_K:
        cure = f"let the wire cool; if it is cold, {CHECK_CALIBRATION}"
    else:
        return ()
    return (f"the unheated wire reads {temperature_c:.1f} °C, {_compared(ambient_c)}: {cure}",)


def calibration_caveats(corrected_c: float, ambient_c: float) -> tuple[str, ...]:
    """Return a caveat if a calibration changes a reading of `ambient_c` too much, to `corrected_c`; else nothing."""
    if abs(corrected_c - ambient_c) <= COLD_WIRE_K:
        return ()
    corrected = f"the calibration corrects a reading of {ambient_c:g} °C to {corrected_c:.1f} °C"
    return (f"{corrected}, {_compared(ambient_c)}: is the known value right? If not, {CHECK_CALIBRATION}",)


def _compared(ambient_c: float) -> str:
    return f"more than {COLD_WIRE_K:g} K from ambient_c = {ambient_c:g} °C"
