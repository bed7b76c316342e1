"""The reading of an unheated wire, compared with the ambient temperature of the wire file; doubtful calibrations.

A wire cannot be colder than its surroundings, and an unheated wire is not warmer for long. If the reading differs from
the ambient temperature by more than `COLD_WIRE_K`, the calibration of the thermocouple or `ambient_c` of the wire file
is wrong. With a wrong calibration the reading may be far too low, and the wire would become hotter than the temperature
limits allow. A wrong scale shows less at the ambient temperature than at `temperature_max_c`, so a calibration is
checked there, too.
"""

from __future__ import annotations

from collections.abc import Callable

COLD_WIRE_K = 10.0
"""Largest difference, K: 5 K for an uncalibrated thermocouple, and 5 K between the room and `ambient_c`."""

CHECK_CALIBRATION = "calibrate the thermocouple again, or correct ambient_c in the wire file"


def is_too_cold(temperature_c: float, ambient_c: float) -> bool:
    """Return True if a wire at `ambient_c` cannot have this temperature; False for NaN."""
    return temperature_c < ambient_c - COLD_WIRE_K


def cold_wire_caveats(temperature_c: float, ambient_c: float) -> tuple[str, ...]:
    """Return a caveat if the reading of the unheated wire is too far from the ambient temperature; () otherwise."""
    if is_too_cold(temperature_c, ambient_c):
        cure = f"{CHECK_CALIBRATION}, before the wire is heated"
    elif temperature_c > ambient_c + COLD_WIRE_K:
        cure = f"let the wire cool; if it is cold, {CHECK_CALIBRATION}"
    else:
        return ()
    return (f"the unheated wire reads {temperature_c:.1f} °C, {_compared(ambient_c)}: {cure}",)


def calibration_caveats(corrected_c: float, ambient_c: float) -> tuple[str, ...]:
    """Return a caveat if a calibration changes a reading of `ambient_c` too much, to `corrected_c`; () otherwise."""
    if abs(corrected_c - ambient_c) <= COLD_WIRE_K:
        return ()
    corrected = f"the calibration corrects a reading of {ambient_c:g} °C to {corrected_c:.1f} °C"
    return (f"{corrected}, {_compared(ambient_c)}: is the known value right? If not, {CHECK_CALIBRATION}",)


def limit_caveats(correct: Callable[[float], float], ambient_c: float, limit_c: float) -> tuple[str, ...]:
    """Return a caveat if a calibration lowers a reading of `limit_c` too much; () otherwise.

    `correct` returns the corrected value of a reading in °C, `limit_c` is `temperature_max_c` of the rig. A calibration
    that raises the reading keeps the wire colder. One that is already wrong at `ambient_c` has a caveat of its own.
    """
    corrected_c = correct(limit_c)
    if corrected_c >= limit_c - COLD_WIRE_K or calibration_caveats(correct(ambient_c), ambient_c):
        return ()
    lowered = f"the calibration lowers a reading of temperature_max_c = {limit_c:g} °C to {corrected_c:.1f} °C"
    cure = "If not, the wire becomes hotter than its limit: calibrate the thermocouple again"
    return (f"{lowered}, by more than {COLD_WIRE_K:g} K: are the known values right? {cure}",)


def _compared(ambient_c: float) -> str:
    return f"more than {COLD_WIRE_K:g} K from ambient_c = {ambient_c:g} °C"
