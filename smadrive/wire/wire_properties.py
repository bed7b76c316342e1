"""The properties of a wire that stay the same while its hysteresis model is tuned or adapted."""

from __future__ import annotations

from dataclasses import dataclass

from smadrive.hysteresis import IdentifiedModel
from smadrive.wire.heat_balance import HeatBalance
from smadrive.wire.identified_resistance import WireResistance
from smadrive.wire.identified_wire import IdentifiedWire
from smadrive.wire.wire_model import WireModel


@dataclass(frozen=True)
class WireProperties:
    """Heat balance and resistance of a wire.

    `resistance` is the resistance over temperature and phase; None if it was not identified.
    """

    balance: HeatBalance
    resistance: WireResistance | None = None

    def wire_model(self, model: IdentifiedModel) -> WireModel:
        """Return the wire with the hysteresis model `model`, as a model that can be stepped."""
        return WireModel(model, self.balance, self.resistance)

    def identified(self, model: IdentifiedModel) -> IdentifiedWire:
        """Return the wire with the hysteresis model `model`, as its file or a log contains it."""
        return IdentifiedWire.of(self.wire_model(model))
