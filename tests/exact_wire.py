"""A wire that is known exactly: a model without identification, for runs that need any usable wire."""

from firmware_sim.config import load_sim
from smadrive.hysteresis import DuhemModel
from smadrive.wire.heat_balance import HeatBalance
from smadrive.wire.identified_wire import IdentifiedWire


def exact_wire():
    """The wire of the shipped simulation, as a perfect identification would find it."""
    sim = load_sim("flexinol-lt-0.15mm")
    wire, loop = sim.wire, sim.transformation
    model = DuhemModel.gaussian(
        mu_heating=loop.mu_heating_c,
        mu_cooling=loop.mu_cooling_c,
        sigma_heating=loop.sigma_heating_c,
        sigma_cooling=loop.sigma_cooling_c,
        scale=wire.stroke_mm,
        offset=0.0,
        input_range=(20.0, 130.0),
    )
    balance = HeatBalance(
        heat_capacity_j_per_k=wire.heat_capacity_j_per_k,
        loss_w_per_k=wire.loss_w_per_k,
        latent_heat_j=wire.mass_kg * wire.latent_heat_j_per_kg,
        ambient_c=wire.ambient_c,
        resistance_cold_ohm=wire.resistance_cold_ohm,
        resistance_change=wire.resistance_change,
        thermocouple_lag_s=sim.thermocouple.lag_s,
    )
    return IdentifiedWire(model, balance)
