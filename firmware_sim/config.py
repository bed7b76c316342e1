"""SIM.toml, the description of a simulated bench: a wire, its sensors, and the devices that heat or measure it."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Literal

from pydantic import Field, model_validator

from smadrive.files.config import Section, load_config
from smadrive.files.kinds import SIM
from smadrive.files.shipped import config_file

MAX_SIGMA_C = 100.0
"""The largest width of a branch, °C.

A Preisach plane has cells of 0.25 K, so the number of its cells grows with the square of the width.
"""


HysteresisKind = Literal["duhem", "two-component", "preisach"]


class Implementation(StrEnum):
    """The firmware of an `sma-reference` board."""

    PYTHON = "python"
    NATIVE = "native"
    ATMEGA328P = "atmega328p"


class Wire(Section):
    """The wire as one lumped mass. The latent heat is in J/kg, so the wire needs `mass_kg` too.

    `resistance_change` is the relative change of the resistance from the cold wire to the hot wire.
    """

    heat_capacity_j_per_k: float = Field(gt=0)
    loss_w_per_k: float = Field(gt=0)
    mass_kg: float = Field(gt=0)
    latent_heat_j_per_kg: float = Field(ge=0)
    resistance_cold_ohm: float = Field(gt=0)
    resistance_change: float = Field(gt=-1)
    ambient_c: float
    stroke_mm: float = Field(gt=0)


class RPhase(Section):
    """The R-phase, which forms from austenite on cooling.

    rise       relative increase of the resistivity when austenite becomes R-phase
    centre_c   temperature at which half of the austenite is R-phase, °C
    sigma_c    width of the transition (standard deviation of a Gaussian), °C
    """

    rise: float = Field(gt=0, le=0.5)
    centre_c: float
    sigma_c: float = Field(gt=0, le=MAX_SIGMA_C)


class Resistance(Section):
    """The effects of temperature, strain and R-phase on the resistance of the wire; see physics/resistance.py.

    `martensite_per_k` and `austenite_per_k` are temperature coefficients at the ambient temperature. `strain` is the
    strain of the cold wire as a fraction: a longer and thinner wire has a larger resistance.
    """

    martensite_per_k: float = Field(default=0.0, ge=-0.01, le=0.01)
    austenite_per_k: float = Field(default=0.0, ge=-0.01, le=0.01)
    strain: float = Field(default=0.0, ge=0, le=0.1)
    r_phase: RPhase | None = None


class Branches(Section):
    """Centre and width of the two branches of the hysteresis, in °C.

    With `[bias]` these are the values of the unloaded wire, without `[bias]` the values under its load.
    """

    mu_heating_c: float
    mu_cooling_c: float
    sigma_heating_c: float = Field(gt=0, le=MAX_SIGMA_C)
    sigma_cooling_c: float = Field(gt=0, le=MAX_SIGMA_C)


class Component(Branches):
    """A second transformation in the same wire, such as an R-phase: its branches, and its share of the stroke."""

    share: float = Field(gt=0, lt=1)


class Transformation(Branches):
    """The hysteresis of the wire: a Duhem model with one or two Gaussians per branch, or a Preisach plane.

    Only a Preisach plane has a `correlation`. Each grain of the wire turns to austenite at one temperature, and back to
    martensite at a lower temperature. `correlation` is the correlation of these two temperatures over all grains. With
    a larger correlation, the widths of the grains' hysteresis differ less.
    """

    kind: HysteresisKind = "duhem"
    range_c: tuple[float, float]
    second: Component | None = None
    correlation: float | None = Field(default=None, gt=-1, lt=1)

    @model_validator(mode="after")
    def _consistent(self) -> Transformation:
        if self.range_c[0] >= self.range_c[1]:
            raise ValueError(f"range_c {self.range_c} does not increase: write the lower end first")
        for key, kind in (("second", "two-component"), ("correlation", "preisach")):
            if (getattr(self, key) is not None) != (self.kind == kind):
                raise ValueError(f"kind = '{kind}' and the key '{key}' need each other: write both, or neither")
        return self


class Bias(Section):
    """The load that stretches the cooling wire: a dead weight, or a spring that the contracting wire stretches.

    Stress = (preload + stiffness · displacement) / cross section. With a bias, `[transformation]` holds the
    temperatures of the unloaded wire. The stress raises the temperatures of the heating branch by 1 K per
    `heating_mpa_per_k`, and the temperatures of the cooling branch by 1 K per `cooling_mpa_per_k` (Clausius-Clapeyron).
    """

    preload_n: float = Field(ge=0)
    stiffness_n_per_mm: float = Field(default=0.0, ge=0)
    diameter_mm: float = Field(gt=0)
    heating_mpa_per_k: float = Field(gt=0)
    cooling_mpa_per_k: float = Field(gt=0)


class Thermocouple(Section):
    """The thermocouple on the wire and its converter.

    `quantum_c` is the resolution of the converter, `conversion_s` the time between two readings.
    """

    lag_s: float = Field(ge=0)
    noise_c: float = Field(ge=0)
    quantum_c: float = Field(gt=0)
    conversion_s: float = Field(ge=0.01, le=0.1)
    cold_junction_c: float
    cold_junction_drift_c_per_h: float = 0.0


class Displacement(Section):
    """The displacement sensor. Without this table the bench has no displacement sensor."""

    noise_mm: float = Field(ge=0)


class Sense(Section):
    """The measurement of heater voltage and current by the device that heats.

    A quantum is the resolution of a converter: readings are rounded to multiples of it, and not rounded if it is 0. The
    device measures the voltage at its own terminals (two-wire sensing), so the measured resistance includes `lead_ohm`,
    the resistance of leads and contacts.
    """

    current_noise_a: float = Field(ge=0)
    voltage_noise_v: float = Field(ge=0)
    current_quantum_a: float = Field(default=0.0, ge=0)
    voltage_quantum_v: float = Field(default=0.0, ge=0)
    lead_ohm: float = Field(default=0.0, ge=0)


class Board(Section):
    """Power-up defaults and hardware limits of the board. Without `serial_number` each start picks a random number.

    `implementation` is the firmware of an `sma-reference` board: in Python, the C core compiled for this computer, or
    the program of the ATmega328P on an emulated microcontroller.
    """

    watchdog_s: float = Field(ge=0.05, le=10)
    temperature_max_c: float
    supply_limit_a: float = Field(gt=0)
    serial_number: int | None = Field(default=None, ge=0, le=0xFFFFFFFF)
    implementation: Implementation = Implementation.PYTHON


class DeviceEntry(Section):
    """A device on the bench, and its listen address. Devices with the same listen address share a line."""

    name: str = Field(min_length=1)
    profile: str
    unit_id: int | None = Field(default=None, ge=0, le=255)
    pty: str | None = None
    tcp: str | None = None
    rtu_tcp: str | None = None

    @model_validator(mode="after")
    def _one_listen_address(self) -> DeviceEntry:
        if sum(address is not None for address in (self.pty, self.tcp, self.rtu_tcp)) != 1:
            raise ValueError(
                f"device '{self.name}' needs exactly one of pty = PATH, tcp = ADDRESS and rtu_tcp = ADDRESS"
            )
        return self


class SimConfig(Section):
    """The content of a SIM.toml.

    A SIM.toml without `devices` gives a bench with one device. The program that makes the bench chooses this device.
    """

    wire: Wire
    transformation: Transformation
    thermocouple: Thermocouple
    sense: Sense
    board: Board
    displacement: Displacement | None = None
    bias: Bias | None = None
    resistance: Resistance | None = None
    devices: tuple[DeviceEntry, ...] = ()

    @model_validator(mode="after")
    def _names_differ(self) -> SimConfig:
        names = [device.name for device in self.devices]
        for name in names:
            if names.count(name) > 1:
                raise ValueError(f"two devices are called '{name}': give them different names")
        return self


def load_sim(name_or_path: str | Path) -> SimConfig:
    """Load a SIM.toml and return its content. `name_or_path` is a path that ends in .toml, or a shipped name.

    ConfigError when the file is missing or wrong; the error names file, key and cure.
    """
    return load_config(config_file(name_or_path, SIM), SimConfig)
