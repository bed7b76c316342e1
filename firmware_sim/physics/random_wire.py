"""Random wires around a nominal wire. They scatter like wires of one type in rigs that different people build.

    μ ±5 K (each branch)   σ ±25 % (each branch)   stroke ±10 %   m c, h A, latent heat ±25 %   R ±5 %
    thermocouple lag 50 to 250 ms, noise 0.1 K   strain 3 to 4.5 %   leads 0.5 to 3 % of R   change of R ±30 %
    temperature coefficients of R in 1e-3/K: 0.6 to 1.0 (martensite), 0.3 to 0.7 (austenite)

μ and σ are the centre and the width of a branch, m c is the heat capacity, h A the heat loss per kelvin, R the
resistance. One wire of four has an R-phase, which raises the resistivity of the austenite by 2 to 6 % near the cooling
branch. The values are uniform and independent. The kind of hysteresis does not depend on the nominal wire.
On average, three of five wires get one Gaussian per branch, one wire gets a second component between its branches (as
from an R-phase), and one wire gets a Preisach plane. If the branches cross in the working range, which is not physical,
new branches are drawn.
"""

from __future__ import annotations

from random import Random
from typing import Any

from firmware_sim.config import HysteresisKind, Resistance, RPhase, SimConfig, Transformation
from firmware_sim.physics.transformation import Duhem
from smadrive.errors import ModelError

KINDS: tuple[HysteresisKind, ...] = ("duhem", "two-component", "preisach")
SHARES = (3, 1, 1)
R_PHASE_ONE_IN = 4
REACH = 4.5  # working range beyond the centres, in standard deviations: the transformation is complete at its ends


def random_wire(nominal: SimConfig, seed: int, kind: HysteresisKind | None = None) -> SimConfig:
    """Return the config of a bench like `nominal`, with a random wire. Without `kind` its kind of hysteresis is random.

    The same arguments give the same wire.
    """
    random = Random(seed)

    def within(share: float) -> float:
        return random.uniform(1.0 - share, 1.0 + share)

    wire = nominal.wire
    wires = {
        "heat_capacity_j_per_k": wire.heat_capacity_j_per_k * within(0.25),
        "loss_w_per_k": wire.loss_w_per_k * within(0.25),
        "latent_heat_j_per_kg": wire.latent_heat_j_per_kg * within(0.25),
        "resistance_cold_ohm": wire.resistance_cold_ohm * within(0.05),
        "stroke_mm": wire.stroke_mm * within(0.10),
    }
    thermocouple = {"lag_s": random.uniform(0.05, 0.25), "noise_c": 0.1}
    random_kind = random.choices(KINDS, SHARES)[0]
    random_transformation = _transformation(nominal.transformation, kind or random_kind, random)
    of_resistance = Random(f"resistance {seed}")  # a separate generator: the values from `random` do not change
    wires["resistance_change"] = wire.resistance_change * of_resistance.uniform(0.7, 1.3)
    lead_ohm = wires["resistance_cold_ohm"] * of_resistance.uniform(0.005, 0.03)
    return nominal.model_copy(
        update={
            "wire": wire.model_copy(update=wires),
            "thermocouple": nominal.thermocouple.model_copy(update=thermocouple),
            "transformation": random_transformation,
            "sense": nominal.sense.model_copy(update={"lead_ohm": lead_ohm}),
            "resistance": _resistance(random_transformation.mu_cooling_c, of_resistance),
        }
    )


def _resistance(cooling_c: float, random: Random) -> Resistance:
    """Return the dependence of the resistance for a wire whose cooling branch has its centre at `cooling_c`."""
    r_phase = {"rise": random.uniform(0.02, 0.06), "centre_c": cooling_c + random.uniform(-5.0, 10.0), "sigma_c": 3.0}
    values = {
        "martensite_per_k": random.uniform(0.6e-3, 1.0e-3),
        "austenite_per_k": random.uniform(0.3e-3, 0.7e-3),
        "strain": random.uniform(0.03, 0.045),
    }
    has_r_phase = random.randrange(R_PHASE_ONE_IN) == 0
    return Resistance(**values, r_phase=RPhase(**r_phase) if has_r_phase else None)


def _transformation(nominal: Transformation, kind: HysteresisKind, random: Random) -> Transformation:
    while True:
        branches = _branches(nominal, random)
        try:
            candidate = Transformation.model_validate({"kind": kind} | branches | _extras(kind, branches, random))
            Duhem(candidate)  # a Preisach plane has these branches too
        except ModelError:
            continue
        return candidate


def _branches(nominal: Transformation, random: Random) -> dict[str, Any]:
    up_c, down_c = (mu_c + random.uniform(-5.0, 5.0) for mu_c in (nominal.mu_heating_c, nominal.mu_cooling_c))
    up_k, down_k = (
        sigma_c * random.uniform(0.75, 1.25) for sigma_c in (nominal.sigma_heating_c, nominal.sigma_cooling_c)
    )
    reach_k = REACH * max(up_k, down_k)
    return {
        "mu_heating_c": up_c,
        "mu_cooling_c": down_c,
        "sigma_heating_c": up_k,
        "sigma_cooling_c": down_k,
        "range_c": (down_c - reach_k, up_c + reach_k),
    }


def _extras(kind: HysteresisKind, branches: dict[str, Any], random: Random) -> dict[str, Any]:
    """Return the parameters that this kind of hysteresis needs in addition to the two branches."""
    if kind == "preisach":
        return {"correlation": random.uniform(0.4, 0.8)}
    if kind == "duhem":
        return {}
    width_k = branches["mu_heating_c"] - branches["mu_cooling_c"]
    sigma_c = random.uniform(0.5, 0.8) * min(branches["sigma_heating_c"], branches["sigma_cooling_c"])
    second = {
        "share": random.uniform(0.1, 0.3),
        "mu_heating_c": branches["mu_heating_c"] - width_k * random.uniform(0.1, 0.3),
        "mu_cooling_c": branches["mu_cooling_c"] + width_k * random.uniform(0.1, 0.4),
        "sigma_heating_c": sigma_c,
        "sigma_cooling_c": sigma_c,
    }
    return {"second": second}
