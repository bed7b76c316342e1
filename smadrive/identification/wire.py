"""Identification of a wire from one recorded excitation: first its heat balance, then its hysteresis.

The order matters. The thermocouple lags the wire by about 0.1 s, which at a few K/s is several tenths of a kelvin. In
the middle of the loop 1 K is 5 to 7 % of the stroke. So a hysteresis model that is fitted to the reading would be too
wide. The thermal fit comes first, and the hysteresis model is fitted to the temperature of the wire itself.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, NamedTuple

from numpy.typing import ArrayLike

from smadrive.hysteresis import DuhemModel, TSFuzzyDuhem, TSFuzzyPreisach
from smadrive.identification.duhem import identify_duhem
from smadrive.identification.excitation import ExcitationRecord
from smadrive.identification.memory.fit import MemoryFit, identify_memory
from smadrive.identification.quality.fit import Fit
from smadrive.identification.thermal import ThermalFit, identify_thermal
from smadrive.wire.heat_balance import HeatBalance
from smadrive.wire.identified_wire import IdentifiedWire

Kind = Literal["tsfuzzy", "duhem"]

AnyFit = Fit[TSFuzzyDuhem] | Fit[TSFuzzyPreisach] | Fit[DuhemModel] | MemoryFit

FUZZY_SETS = 11
"""Fuzzy sets of a T-S fuzzy fit."""

DUHEM_COMPONENTS = 2
"""Gaussians per branch of a Duhem fit: measured wires need two."""


class FitSettings(NamedTuple):
    """What model to fit.

    kind         T-S fuzzy model, or Duhem model
    sets         fuzzy sets of a T-S fuzzy model
    memory       sets of the last turning point of a T-S fuzzy model; None lets held-out loops decide, 1 is no memory
    components   Gaussians per branch of a Duhem model
    """

    kind: Kind = "tsfuzzy"
    sets: int = FUZZY_SETS
    memory: int | None = None
    components: int = DUHEM_COMPONENTS


STANDARD_FIT = FitSettings()


@dataclass(frozen=True)
class WireFit:
    """The thermal fit and the hysteresis fit of one record."""

    thermal: ThermalFit
    hysteresis: AnyFit

    @property
    def wire(self) -> IdentifiedWire:
        """The identified wire."""
        fit = self.hysteresis
        return IdentifiedWire(fit.model, self.thermal.balance, fit.caveats, fit.metrics)


def identify_hysteresis(v: ArrayLike, y: ArrayLike, settings: FitSettings) -> AnyFit:
    """Fit output y over input v, both (samples,). Raises the errors of `identify_memory` or `identify_duhem`."""
    if settings.kind == "duhem":
        return identify_duhem(v, y, components=settings.components)
    return identify_memory(v, y, settings.sets, memory=settings.memory)


def identify_wire(
    record: ExcitationRecord,
    start: HeatBalance,
    settings: FitSettings = STANDARD_FIT,
) -> WireFit:
    """Fit heat balance and hysteresis to a recorded excitation.

    The search begins at the nominal heat balance `start`. Raises the errors of `identify_thermal`, and those of
    `identify_hysteresis`.
    """
    thermal = identify_thermal(record, start)
    fit = identify_hysteresis(thermal.wire_temperature_c, record.displacement_mm, settings)
    return WireFit(thermal, fit)
