"""Check of an identified heat balance against the nominal one of the rig's wire.

All that supervises a run relies on the heat balance: with a thermocouple lag in milliseconds instead of seconds no
reading would be implausible, and with ten times the resistance nothing would be heated. So the balance of a model file
must lie near the nominal one of the wire file. The ranges hold what differs between right values: published specific
heats differ by a factor of 2.6, moving air doubles the loss, a bead of glue makes a thermocouple several times slower.
"""

from __future__ import annotations

from smadrive.errors import ConfigError
from smadrive.wire.heat_balance import HeatBalance

FACTORS = {"heat_capacity_j_per_k": 3.0, "loss_w_per_k": 3.0, "resistance_cold_ohm": 2.0}
"""An identified parameter may differ from the nominal one by this factor, up or down."""
LATENT_FACTOR, LATENT_SPAN_K = 5.0, 20.0
"""The most latent heat: a multiple of the nominal one, or the heat capacity times a span, whichever is more."""
LAG_FACTOR, LAG_S = 5.0, 1.0
"""The longest lag: a multiple of the nominal one, or a fixed time, whichever is longer."""
AMBIENT_K = 20.0
"""Largest difference of the ambient temperature."""
RESISTANCE_CHANGE = 0.4
"""Largest difference of the relative change of resistance, whose sign differs between wires."""


def check_same_wire(found: HeatBalance, nominal: HeatBalance, wire: str) -> None:
    """ConfigError when `found` cannot be a heat balance of the wire file `wire`, whose nominal one is `nominal`."""
    most_latent_j = max(LATENT_FACTOR * nominal.latent_heat_j, LATENT_SPAN_K * nominal.heat_capacity_j_per_k)
    ranges = {name: (getattr(nominal, name) / by, getattr(nominal, name) * by) for name, by in FACTORS.items()} | {
        "latent_heat_j": (0.0, most_latent_j),
        "thermocouple_lag_s": (0.0, max(LAG_FACTOR * nominal.thermocouple_lag_s, LAG_S)),
        "ambient_c": (nominal.ambient_c - AMBIENT_K, nominal.ambient_c + AMBIENT_K),
        "resistance_change": (
            nominal.resistance_change - RESISTANCE_CHANGE,
            nominal.resistance_change + RESISTANCE_CHANGE,
        ),
    }
    for name, (low, high) in ranges.items():
        value = getattr(found, name)
        if not low <= value <= high:
            raise ConfigError(
                f"{name} is not that of the rig's wire '{wire}', nominally {getattr(nominal, name):.4g}",
                where="heat balance of the model",
                value=f"{value:.4g}",
                limit=f"{low:.3g} to {high:.3g}",
                cure="identify this wire again, or correct the wire file",
            )
