"""The properties of a wire that stay the same while its hysteresis model is tuned or adapted."""

from __future__ import annotations

from dataclasses import dataclass, replace

from smadrive.hysteresis import IdentifiedModel
from smadrive.wire.heat_balance import HeatBalance
from smadrive.wire.identified_resistance import WireResistance
from smadrive.wire.identified_wire import IdentifiedWire
from smadrive.wire.recorded_loops import Sections
from smadrive.wire.wire_model import WireModel


@dataclass(frozen=True)
class WireProperties:
    """Heat balance, resistance and recorded loops of a wire.

    balance      heat balance
    resistance   resistance over temperature and phase; None if it was not identified
    sections_c   sections of the record of the identification, as (turning point, end) in °C; empty if unknown
    """

    balance: HeatBalance
    resistance: WireResistance | None = None
    sections_c: Sections = ()

    def wire_model(self, model: IdentifiedModel) -> WireModel:
        """Return the wire with the hysteresis model `model`, as a model that can be stepped."""
        return WireModel(model, self.balance, self.resistance)

    def identified(self, model: IdentifiedModel) -> IdentifiedWire:
        """Return the wire with the hysteresis model `model`, as its file or a log contains it."""
        return replace(IdentifiedWire.of(self.wire_model(model)), sections_c=self.sections_c)
