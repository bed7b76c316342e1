"""The faults that the driver detects, each with its number, cause and remedy.

The number of a fault never changes, because logs contain it and users know it. A new fault gets a new number.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import NamedTuple

from smadrive.errors import TripError


class Fault(Enum):
    """A fault that ends a run: number, cause and remedy."""

    OVER_TEMPERATURE = (
        1,
        "the wire is hotter than temperature_max_c",
        "let it cool; lower the reference or current_max_a",
    )
    SENSOR_INVALID = (
        2,
        "the thermocouple gives no valid reading",
        "check the bead, the plug and the polarity, and the cable and supply of a separate thermometer",
    )
    STALE_DATA = (
        3,
        "no fresh measurement arrived in time",
        (
            "check the cable, the port and the device's supply; is the device, or its simulator, stopped, or the "
            "computer too busy? A slow device needs a lower rate_hz or a larger stale_after_s"
        ),
    )
    DEVICE_FAULT = (4, "the device latched a fault of its own", "remove the cause of the device's fault")
    CURRENT_MISMATCH = (5, "the measured current is not the commanded one", "check the wire's clamps and the supply")
    UNEXPECTED_HEATING = (
        6,
        "current flows although no current was commanded",
        "switch the supply off: its switch is shorted",
    )
    DISARMED = (7, "the device stopped heating by itself", "did the device lose its supply? check it, then start again")
    READS_TOO_COLD = (
        8,
        "the thermocouple reads colder than the heat input allows",
        (
            "is the bead tight on the wire? is the polarity of the thermocouple right? is the wire unbroken? is the "
            "convection in the wire file too small?"
        ),
    )
    READS_TOO_HOT = (
        9,
        "the thermocouple reads hotter than the heat input explains",
        "does another heat source warm the wire or the bead? does the wire file describe this wire?",
    )
    UNDER_TEMPERATURE = (
        10,
        "the thermocouple reads colder than temperature_min_c",
        "check the polarity of the thermocouple",
    )
    OVER_DISPLACEMENT = (
        11,
        "the displacement left the range displacement_min_mm to displacement_max_mm",
        "check the mechanics and the sensor",
    )
    TRACKING_LOST = (
        12,
        "the wire does not follow its reference",
        "is the wire blocked, overloaded or slack? identify it again, or choose a slower or smaller reference",
    )
    DEADLINES_MISSED = (13, "the loop missed many deadlines in a row", "lower rate_hz, or stop other programs")
    GUARDIAN = (
        14,
        "the guardian took the heater over",
        "the driver stood still: stop other programs, then start again",
    )

    COMMAND_REFUSED = (
        15,
        "the device refused a command, or lost the commanded value",
        "is the panel of the device locked, or is the device in another mode?",
    )

    SENSOR_FROZEN = (
        16,
        "the thermocouple's reading stands still although the wire's temperature must have changed",
        "restart the converter; check the bead and the plug",
    )

    DISPLACEMENT_IMPLAUSIBLE = (
        17,
        "displacement outside the model's range at this temperature",
        (
            "does the sensor respond, in millimetres, in the right direction, with 0 at the cold wire? is the wire "
            "blocked, slack, or not the identified one? is the bead tight on the wire?"
        ),
    )

    POWER_UNKNOWN = (
        18,
        "the heater's current or voltage is unknown",
        "check the device that measures them, and its profile",
    )

    DISPLACEMENT_UNKNOWN = (
        19,
        "the displacement is unknown, so its limits cannot be checked",
        "check the sensor, its supply and its range",
    )

    RESISTANCE_JUMPED = (
        20,
        "the resistance of the wire is far from that of its last runs, or of its model if they are too few",
        "check crimps, leads and plugs; is it another wire? If wire and circuit are right, identify the wire again",
    )

    RESISTANCE_IMPLAUSIBLE = (
        21,
        "the resistance of the wire does not belong to the reading of the thermocouple",
        (
            "is the bead tight on the wire? has a crimp, lead or plug changed since the identification? is it another "
            "wire? If wire and circuit are right, identify the wire again"
        ),
    )

    def __init__(self, number: int, cause: str, remedy: str) -> None:
        self.number = number
        self.cause = cause
        self.remedy = remedy


CLEAR = (
    "Clear it once its cause is gone: `smadrive off RIG --clear-faults`, Clear faults on the tuning page, or "
    "rig.clear_faults() in Python"
)
"""The cure in errors about a latched fault."""


class Contradiction(NamedTuple):
    """Two measurements that do not belong together: the fault that this is if it lasts, and the values as text."""

    fault: Fault
    detail: str


@dataclass(frozen=True, slots=True)
class Trip:
    """A latched fault, raised at `time_s` on the clock of the driver.

    `detail` is the measured value or the reason, as text. `limit` is the violated limit with its unit; None if the
    fault has no single limit.
    """

    fault: Fault
    time_s: float
    detail: str
    limit: str | None = None

    def __str__(self) -> str:
        """Return one sentence for the user."""
        limit = "" if self.limit is None else f", limit {self.limit}"
        return f"fault {self.fault.number}: {self.fault.cause} ({self.detail}{limit}); {self.fault.remedy}"

    def error(self) -> TripError:
        """Return the error that ends the run."""
        return TripError(str(self), self.fault.number, value=self.detail, limit=self.limit, cure=CLEAR)
