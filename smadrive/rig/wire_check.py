"""Whether an identified heat balance can be that of the rig's wire.

Everything that watches over a run believes the heat balance: with a thermocouple lag told in milliseconds no reading is
implausible any more, with ten times the resistance nothing is heated. So a balance from a model file must lie near the
nominal one of the wire file, as near as the two can be when both are right: published specific heats differ by 2.6, air
that moves takes away twice the heat, a bead of glue makes a thermocouple several times slower.
"""

from __future__ import annotations

from smadrive.errors import ConfigError
from smadrive.wire.heat_balance import HeatBalance

FACTORS = {"heat_capacity_j_per_k": 3.0, "loss_w_per_k": 3.0, "resistance_cold_ohm": 2.0}
"""Within which an identified parameter may differ from the nominal one, both ways."""
LATENT_FACTOR, LATENT_SPAN_K = 5.0, 20.0
"""So much more latent heat than nominal, or what the wire takes up over so many kelvin, where that is more."""
LAG_FACTOR, LAG_S = 5.0, 1.0
"""So much more lag than nominal, or so long, where that is more."""
AMBIENT_K = 20.0
RESISTANCE_CHANGE = 0.4
"""Its sign differs between wires."""


def check_same_wire(found: HeatBalance, nominal: HeatBalance, wire: str) -> None:
    """ConfigError when `found` cannot be a heat balance of the wire file `wire`, whose own is `nominal`."""
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
                f"the model's heat balance is not of the rig's wire: {name} = {value:.4g}, nominal for '{wire}' is "
                f"{getattr(nominal, name):.4g}, {low:.3g} to {high:.3g} can be: identify this wire again, or correct "
                "the wire file"
            )
