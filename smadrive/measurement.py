"""One sample of the wire, and the source of its displacement: the types that the maths and the devices share."""

from __future__ import annotations

from enum import StrEnum
from math import nan
from typing import NamedTuple

from smadrive.display.ascii_text import ascii_text
from smadrive.display.card import card
from smadrive.display.number_text import quantity


class DisplacementFrom(StrEnum):
    """The source of the displacement in a run."""

    SENSOR = "sensor"
    """The displacement sensor, if the rig has one. The resistance replaces a sensor that fails."""
    RESISTANCE = "resistance"
    """The resistance of the wire."""
    NONE = "none"
    """No source: the displacement is only estimated, from temperature and current."""


class Measurement(NamedTuple):
    """One sample of the wire, in engineering units. A quantity that was not measured, or is invalid, is NaN.

    `current_a` and `voltage_v` belong to the period that ends with this sample. `in_force_a` is the current that the
    driver commanded for that period. The command that the same exchange writes acts in the next period. Temperature
    and displacement are the latest readings. A reading of a slower device is older than `time_s`, by
    `temperature_age_s` or `displacement_age_s`.

    `temperature_fault` is the reason for an invalid temperature, such as an open thermocouple; it is None for a valid
    temperature. `supply_fault` is the reason for an invalid current or voltage.
    `device_faults` names the latched faults of the device, and `device_limits` the limits that hold back its output.
    `host_limits` names the limits of the driver that reduced the command of this exchange.
    """

    time_s: float
    temperature_c: float
    current_a: float
    voltage_v: float
    displacement_mm: float = nan
    temperature_fault: str | None = None
    device_faults: tuple[str, ...] = ()
    device_limits: tuple[str, ...] = ()
    host_limits: tuple[str, ...] = ()
    armed: bool = False
    in_force_a: float = 0.0
    temperature_age_s: float = 0.0
    displacement_age_s: float = 0.0
    supply_fault: str | None = None

    @property
    def limits(self) -> tuple[str, ...]:
        """Every limit that holds the output back; the limits of the device come first."""
        return self.device_limits + self.host_limits

    def facts(self) -> tuple[tuple[str, str], ...]:
        """Return name and value with unit of each quantity, and the names of faults and limits if there are any."""
        temperature = self.temperature_fault or quantity(self.temperature_c, 2, "°C")
        faults = ((", ".join(self.device_faults), "faults"), (", ".join(self.limits), "limited by"))
        return (
            ("temperature", temperature),
            ("displacement", quantity(self.displacement_mm, 4, "mm")),
            ("current", self.supply_fault or quantity(self.current_a, 4, "A")),
            ("voltage", self.supply_fault or quantity(self.voltage_v, 3, "V")),
            *((name, text) for text, name in faults if text),
        )

    def __repr__(self) -> str:
        return ascii_text(f"Measurement({', '.join(f'{name} {value}' for name, value in self.facts())})")

    def _repr_html_(self) -> str:
        return card("Measurement", self.facts())
