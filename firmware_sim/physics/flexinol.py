"""Simulated benches for Flexinol actuator wire of any diameter on sale, from published data.

The vendor's table gives the resistance, and the current that contracts the wire in one second. Morgan's correlation
for thin cylinders in still air (Advances in Heat Transfer 11, 1975) gives the heat loss h in W/(m² K):

    h = Nu k/d          Nu = C Ra^n          Ra = g β (T - T_amb) d³/(ν α)

Nu and Ra are the Nusselt and Rayleigh numbers, C and n Morgan's constants, d the diameter, T the wire temperature. The
air at film temperature (T + T_amb)/2 has conductivity k, expansion β, viscosity ν and diffusivity α.

Thin wires need two corrections. First, a sleeve of still air surrounds a wire of radius r, out to the radius r
e^(2/Nu). The sleeve warms and cools with the wire. At 0.025 mm the sleeve stores more than half as much heat as the
wire. Second, the vendor's current heats the wire until it contracts. So the loss at this temperature cannot exceed the
heat of the current. At 0.025 and 0.05 mm this limit is lower than the loss of the correlation.

The centres of the heating branch (μ₊) and of the cooling branch (μ₋) were measured in °C at the stress s in MPa:
μ₊ = 77.6 + 0.1233 s, μ₋ = 55.5 + 0.1352 s. The temperatures of HT wire are 20 K higher.
"""

from __future__ import annotations

from math import exp, log, pi
from typing import Literal, NamedTuple

from firmware_sim.config import (
    Bias,
    Board,
    Displacement,
    Sense,
    SimConfig,
    Thermocouple,
    Transformation,
    Wire,
)
from smadrive.errors import ConfigError

DENSITY_KG_PER_M3 = 6450.0
HEAT_CAPACITY_J_PER_KG_K = 837.0
LATENT_HEAT_J_PER_KG = 24200.0
STRAIN = 0.04
AMBIENT_C = 22.0
HEATING_C, HEATING_MPA_PER_K = 77.6, 1 / 0.1233
COOLING_C, COOLING_MPA_PER_K = 55.5, 1 / 0.1352
SIGMA_K = 5.0
HIGHER_C = {"LT": 0.0, "HT": 20.0}
TABLE_MPA = 172.0  # the stress for which the vendor's currents hold
BIAS_MPA = 100.0
WARM_C = 80.0  # the wire temperature at which h is evaluated


class TableRow(NamedTuple):
    """A row of the vendor's table: the resistance, and the current that contracts the wire in one second."""

    ohm_per_m: float
    contracting_a: float


TABLE = {
    0.025: TableRow(1425.0, 0.045),
    0.05: TableRow(500.0, 0.085),
    0.076: TableRow(232.0, 0.15),
    0.10: TableRow(126.0, 0.2),
    0.15: TableRow(55.0, 0.41),
    0.20: TableRow(29.0, 0.66),
    0.25: TableRow(18.5, 1.05),
    0.31: TableRow(12.2, 1.5),
    0.38: TableRow(8.3, 2.25),
    0.51: TableRow(4.3, 4.0),
}


def flexinol(diameter_mm: float, length_m: float = 0.3, alloy: Literal["LT", "HT"] = "LT") -> SimConfig:
    """Return the config of a bench with a wire of this diameter, length and alloy, under a weight of 100 MPa.

    ConfigError for a diameter that is not sold.
    """
    if diameter_mm not in TABLE:
        made = ", ".join(f"{diameter:g}" for diameter in TABLE)
        raise ConfigError(
            "no wire of this diameter is sold",
            where="flexinol",
            value=f"{diameter_mm:g} mm",
            cure=f"choose one of {made} mm",
        )
    row, area_mm2 = TABLE[diameter_mm], pi * diameter_mm**2 / 4
    mass_kg = DENSITY_KG_PER_M3 * area_mm2 * 1e-6 * length_m
    air = still_air(diameter_mm * 1e-3, WARM_C - AMBIENT_C)
    stroke_mm, higher_c = STRAIN * length_m * 1e3, HIGHER_C[alloy]
    return SimConfig(
        wire=Wire(
            heat_capacity_j_per_k=mass_kg * HEAT_CAPACITY_J_PER_KG_K + air.sleeve_j_per_m_k * length_m,
            loss_w_per_k=min(air.loss_w_per_m_k, _max_loss_w_per_m_k(row)) * length_m,
            mass_kg=mass_kg,
            latent_heat_j_per_kg=LATENT_HEAT_J_PER_KG,
            resistance_cold_ohm=row.ohm_per_m * length_m,
            resistance_change=-0.12,
            ambient_c=AMBIENT_C,
            stroke_mm=stroke_mm,
        ),
        transformation=Transformation(
            mu_heating_c=HEATING_C + higher_c,
            mu_cooling_c=COOLING_C + higher_c,
            sigma_heating_c=SIGMA_K,
            sigma_cooling_c=SIGMA_K,
            range_c=(0.0, 250.0),
        ),
        bias=Bias(
            preload_n=BIAS_MPA * area_mm2,
            diameter_mm=diameter_mm,
            heating_mpa_per_k=HEATING_MPA_PER_K,
            cooling_mpa_per_k=COOLING_MPA_PER_K,
        ),
        thermocouple=Thermocouple(lag_s=0.15, noise_c=0.1, quantum_c=0.0078, conversion_s=0.02, cold_junction_c=25.0),
        displacement=Displacement(noise_mm=stroke_mm * 1e-3),
        sense=Sense(current_noise_a=0.0005 * row.contracting_a, voltage_noise_v=0.002),
        board=Board(watchdog_s=0.5, temperature_max_c=160.0 + higher_c, supply_limit_a=min(2 * row.contracting_a, 5.0)),
    )


class StillAir(NamedTuple):
    """The heat loss to the air in W/(m K), and the heat capacity of the air sleeve in J/(m K), per metre of wire."""

    loss_w_per_m_k: float
    sleeve_j_per_m_k: float


def still_air(diameter_m: float, excess_k: float) -> StillAir:
    """Return heat loss and air sleeve of a wire in free convection, `excess_k` above the ambient temperature."""
    film_k = 273.15 + AMBIENT_C + excess_k / 2
    conductivity = 0.0241 * (film_k / 273.15) ** 0.81
    viscosity = 13.3e-6 * (film_k / 273.15) ** 1.75
    rayleigh = 9.81 / film_k * excess_k * diameter_m**3 / (viscosity**2 / 0.71)
    factor, exponent = (0.675, 0.058) if rayleigh < 1e-2 else (1.02, 0.148)
    nusselt = factor * rayleigh**exponent
    inner_m, outer_m = diameter_m / 2, diameter_m / 2 * exp(2 / nusselt)
    mean_area = pi * ((outer_m**2 - inner_m**2) / (2 * log(outer_m / inner_m)) - inner_m**2)  # a logarithmic profile
    return StillAir(pi * nusselt * conductivity, 1.293 * 273.15 / film_k * 1006.0 * mean_area)


def _max_loss_w_per_m_k(row: TableRow) -> float:
    """Return the heat loss, W/(m K), with which the vendor's current just holds the temperature of a contracted wire.

    The contracted wire is an HT wire, 2 σ above the centre of its heating branch.
    """
    contracted_c = HEATING_C + TABLE_MPA / HEATING_MPA_PER_K + HIGHER_C["HT"] + 2 * SIGMA_K
    return row.contracting_a**2 * row.ohm_per_m / (contracted_c - AMBIENT_C)
