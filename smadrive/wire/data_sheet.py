"""A wire file: the data sheet of a wire, its nominal heat balance, and the checks of its resistance.

**Alloy.** A wire of diameter d with the resistance R' per metre has the resistivity rho = R' π d² / 4. Nickel-titanium
has about 0.8 µΩ·m, copper-based shape-memory alloys have about 0.1 µΩ·m, copper itself has 0.017 µΩ·m. A resistivity
outside `RESISTIVITIES_UOHM_M` is a mistyped number.

**Measurement.** The measured resistance includes leads and clamps. A difference from the data sheet by more than the
factor `RESISTANCE_FACTOR` means a wrong wire file.
"""

from __future__ import annotations

from math import pi
from typing import Self

from pydantic import Field, model_validator

from smadrive.files.config import Section, load_config
from smadrive.files.kinds import WIRE
from smadrive.files.shipped import config_file
from smadrive.wire.heat_balance import BalanceSource, HeatBalance

AGEING_C = 200.0
"""Above this temperature in °C nickel-titanium ages permanently. The wire file of another alloy sets its own limit."""

RESISTIVITIES_UOHM_M = (0.03, 5.0)
"""Lowest and highest resistivity of a wire in µΩ·m."""

RESISTANCE_FACTOR = 1.5
"""Largest factor, up or down, between the measured resistance and the data sheet."""

LEADS_OHM = 0.5
"""Assumed largest resistance of leads and clamps, Ω. It matters for a short thick wire."""


class WireDataSheet(Section):
    """A wire as its data sheet describes it.

    The wire withstands `temperature_max_c` permanently, and no rig file may allow more. The default is `AGEING_C`.

    Each value has bounds that are far wider than usual wires need. So a value outside its bounds is probably in a wrong
    unit, such as metres instead of millimetres.
    """

    name: str
    diameter_mm: float = Field(ge=0.01, le=10)
    length_mm: float = Field(ge=2, le=100_000)
    resistance_ohm_per_m: float = Field(ge=0.02, le=20_000)
    resistance_change: float = Field(gt=-1, lt=1)
    density_kg_per_m3: float = Field(ge=1000, le=30_000)
    specific_heat_j_per_kg_k: float = Field(ge=50, le=5000)
    latent_heat_j_per_kg: float = Field(ge=0, le=1e6)
    convection_w_per_m2_k: float = Field(ge=1, le=1e5)
    ambient_c: float = Field(ge=-100, le=150)
    thermocouple_lag_s: float = Field(ge=0, le=10)
    temperature_max_c: float = Field(default=AGEING_C, ge=30, le=350)

    @model_validator(mode="after")
    def _has_a_resistivity(self) -> Self:
        """Return the data sheet. Raise an error if no alloy has the resistivity that follows from its values."""
        found, (low, high) = resistivity_uohm_m(self.diameter_mm, self.resistance_ohm_per_m), RESISTIVITIES_UOHM_M
        if not low <= found <= high:
            least, most = (self.resistance_ohm_per_m * bound / found for bound in (low, high))
            raise ValueError(
                f"resistance_ohm_per_m = {self.resistance_ohm_per_m:g} is impossible for diameter_mm = "
                f"{self.diameter_mm:g}: an alloy of {low:g} to {high:g} µΩ·m gives {least:.2g} to {most:.2g} Ω/m. Is "
                "the resistance in ohms per metre, and the diameter in millimetres?"
            )
        return self

    def heat_balance(self) -> HeatBalance:
        """Return the nominal heat balance. The mass follows from the volume, the heat loss from the lateral surface."""
        diameter_m, length_m = 1e-3 * self.diameter_mm, 1e-3 * self.length_mm
        mass_kg = self.density_kg_per_m3 * 0.25 * pi * diameter_m**2 * length_m
        return HeatBalance(
            heat_capacity_j_per_k=mass_kg * self.specific_heat_j_per_kg_k,
            loss_w_per_k=self.convection_w_per_m2_k * pi * diameter_m * length_m,
            latent_heat_j=mass_kg * self.latent_heat_j_per_kg,
            ambient_c=self.ambient_c,
            resistance_cold_ohm=self.resistance_ohm_per_m * length_m,
            resistance_change=self.resistance_change,
            thermocouple_lag_s=self.thermocouple_lag_s,
            source=BalanceSource.DATA_SHEET,
        )


def load_data_sheet(name: str) -> WireDataSheet:
    """Return the data sheet in a wire file. `name` is a path that ends in .toml, or the name of a shipped file.

    ConfigError for a missing or invalid file.
    """
    return load_config(config_file(name, WIRE), WireDataSheet)


def resistivity_uohm_m(diameter_mm: float, resistance_ohm_per_m: float) -> float:
    """Return the resistivity in µΩ·m: the resistance in Ω/m times the cross-section in mm²."""
    return resistance_ohm_per_m * 0.25 * pi * diameter_mm**2


def resistance_caveats(measured_ohm: float, nominal: HeatBalance) -> tuple[str, ...]:
    """Return a caveat if the measured resistance does not fit the data sheet; () if it fits, and for NaN."""
    ends_ohm = nominal.resistance_ohm(0.0), nominal.resistance_ohm(1.0)
    low_ohm, high_ohm = min(ends_ohm) / RESISTANCE_FACTOR, RESISTANCE_FACTOR * (max(ends_ohm) + LEADS_OHM)
    if not (measured_ohm < low_ohm or measured_ohm > high_ohm):
        return ()
    limits = f"{low_ohm:.3g} to {high_ohm:.3g} Ω are possible"
    found = f"the measured resistance is {measured_ohm:.3g} Ω, and the wire file gives {ends_ohm[0]:.3g} Ω ({limits})"
    return (f"{found}: check resistance_ohm_per_m, length_mm and the clamps",)
