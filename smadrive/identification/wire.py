"""Identification of a wire from one recorded excitation: first its heat balance, then its hysteresis.

The order matters. The thermocouple lags the wire by about 0.1 s, which at a few K/s is several tenths of a kelvin. In
the middle of the loop 1 K is 5 to 7 % of the stroke. So a hysteresis model that is fitted to the reading would be too
wide. The thermal fit comes first, and the hysteresis model is fitted to the temperature of the wire itself.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from numpy.typing import ArrayLike

from smadrive.hysteresis import DuhemModel, TSFuzzyDuhem
from smadrive.identification.duhem import identify_duhem
from smadrive.identification.excitation import ExcitationRecord
from smadrive.identification.quality.fit import Fit
from smadrive.identification.thermal import ThermalFit, identify_thermal
from smadrive.identification.tsfuzzy.fit import identify_tsfuzzy
from smadrive.wire.heat_balance import HeatBalance
from smadrive.wire.identified_wire import IdentifiedWire

Kind = Literal["tsfuzzy", "duhem"]

AnyFit = Fit[TSFuzzyDuhem] | Fit[DuhemModel]

FUZZY_SETS = 11
"""Fuzzy sets of a T-S fuzzy fit."""

DUHEM_COMPONENTS = 2
"""Gaussians per branch of a Duhem fit: measured wires need two."""


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


def identify_hysteresis(
    v: ArrayLike, y: ArrayLike, kind: Kind, sets: int, components: int = DUHEM_COMPONENTS
) -> AnyFit:
    """Fit output y over input v, both (samples,).

    The model is a T-S fuzzy model of `sets` sets, or a Duhem model of `components` Gaussians for each branch.
    """
    return identify_tsfuzzy(v, y, sets=sets) if kind == "tsfuzzy" else identify_duhem(v, y, components=components)


def identify_wire(
    record: ExcitationRecord,
    start: HeatBalance,
    *,
    kind: Kind = "tsfuzzy",
    sets: int = FUZZY_SETS,
    components: int = DUHEM_COMPONENTS,
) -> WireFit:
    """Fit heat balance and hysteresis to a recorded excitation.

    The search begins at the nominal heat balance `start`. Raises the errors of `identify_thermal`, and those of
    `identify_tsfuzzy` or `identify_duhem`.
    """
    thermal = identify_thermal(record, start)
    fit = identify_hysteresis(thermal.wire_temperature_c, record.displacement_mm, kind, sets, components)
    return WireFit(thermal, fit)
