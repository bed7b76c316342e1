"""The faults of the host: each with its number, cause and remedy.

Numbers are stable, because logs keep them and users know them. A new fault gets a new number.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum


class Fault(Enum):
    """Number, cause, remedy."""

    OVER_TEMPERATURE = (1, "the wire is hotter than temperature_max_c", "let it cool; lower the reference or the limit")
    SENSOR_INVALID = (2, "the thermocouple gives no valid reading", "check the bead, the plug and the polarity")
    STALE_DATA = (
        3,
        "no fresh measurement arrived in time",
        (
            "check the cable, the port and the device's supply; is it, or its simulator, stopped? One that is slow "
            "needs a lower rate_hz or a larger stale_after_s"
        ),
    )
    DEVICE_FAULT = (4, "the device latched a fault of its own", "see the device's fault; remove it, then clear it")
    CURRENT_MISMATCH = (5, "the measured current is not the commanded one", "check the wire's clamps and the supply")
    UNEXPECTED_HEATING = (
        6,
        "current flows although none was commanded",
        "switch the supply off: its switch is shorted",
    )
    DISARMED = (7, "the device stopped heating by itself", "did it lose its supply? look at it, then start again")
    READS_TOO_COLD = (
        8,
        "the thermocouple reads colder than the heat that went in allows",
        "is the bead tight, its polarity right, the wire whole? does the wire file say too little convection?",
    )
    READS_TOO_HOT = (
        9,
        "the thermocouple reads hotter than the heat that went in explains",
        "does something else heat the wire or the bead? is the wire file that of this wire?",
    )
    UNDER_TEMPERATURE = (10, "the wire reads colder than temperature_min_c", "check the thermocouple's polarity")
    OVER_DISPLACEMENT = (
        11,
        "the displacement left displacement_min_mm to displacement_max_mm",
        "look at the mechanics and the sensor",
    )
    TRACKING_LOST = (
        12,
        "the wire does not follow its reference",
        "is it blocked, overloaded or slack? identify it again, or ask less of it",
    )
    DEADLINES_MISSED = (13, "the loop ran late again and again", "lower rate_hz, or free the machine of other work")
    GUARDIAN = (14, "the guardian took the heater over", "the driver stood still: free the machine, then start again")

    COMMAND_REFUSED = (
        15,
        "the device refused or did not keep a command",
        "look at its panel: is it locked, or in another mode?",
    )

    SENSOR_FROZEN = (
        16,
        "the thermocouple's reading stands still although the heat has changed",
        "restart the converter; check the bead and the plug",
    )

    DISPLACEMENT_IMPLAUSIBLE = (
        17,
        "displacement outside the model's range at this temperature",
        "is the sensor alive, in millimetres and zero at the cold wire? is the wire blocked, slack or another one?",
    )

    POWER_UNKNOWN = (
        18,
        "the heater's current or voltage is unknown",
        "check the device that measures them, and its profile",
    )

    DISPLACEMENT_UNKNOWN = (
        19,
        "the displacement is unknown, so that its limits cannot be guarded",
        "check the sensor, its supply and its range",
    )

    def __init__(self, number: int, cause: str, remedy: str) -> None:
        self.number = number
        self.cause = cause
        self.remedy = remedy


CLEAR = "Clear it once its cause is gone: `smadrive off RIG --clear-faults`, or Clear faults on the tuning page"
"""The cure of a latched fault."""


@dataclass(frozen=True, slots=True)
class Trip:
    """A latched fault with the value that raised it."""

    fault: Fault
    time_s: float
    detail: str

    def __str__(self) -> str:
        """One sentence for a person."""
        return f"fault {self.fault.number}: {self.fault.cause} ({self.detail}); {self.fault.remedy}"
