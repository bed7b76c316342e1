"""One sample of the wire: the type that the maths and the devices share."""

from __future__ import annotations

from math import nan
from typing import NamedTuple

from smadrive.display.card import card, quantity


class Measurement(NamedTuple):
    """One sample of the wire, in engineering units. A quantity that was not measured, or is invalid, is NaN.

    `current_a` and `voltage_v` are those of the period that ends with this sample; the driver's command in that period
    was `in_force_a`. The command written by the same exchange acts only afterwards. Temperature and displacement are
    the latest there are; `temperature_age_s` and `displacement_age_s` tell by how much a slower device's reading is
    older than `time_s`.

    `temperature_fault` is the reason for an invalid temperature (open thermocouple, ...), None for a valid one;
    `supply_fault` is the reason for an invalid current or voltage.
    `device_faults` and `device_limits` are the names of the device's own latched faults and "limited by" codes;
    `host_limits` those of the driver, for the command that this exchange sent.
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
        """Every limit that holds the output back, the device's first."""
        return self.device_limits + self.host_limits

    def facts(self) -> tuple[tuple[str, str], ...]:
        """Return the quantities as a person reads them: names and values with units; no faults, no row of them."""
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
        return f"Measurement({', '.join(f'{name} {value}' for name, value in self.facts())})"

    def _repr_html_(self) -> str:
        return card("Measurement", self.facts())
