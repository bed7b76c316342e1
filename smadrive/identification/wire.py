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
from smadrive.wire.recorded_loops import recorded_sections

Kind = Literal["tsfuzzy", "duhem"]

AnyFit = Fit[TSFuzzyDuhem] | Fit[TSFuzzyPreisach] | Fit[DuhemModel] | MemoryFit

FUZZY_SETS = 11
"""Fuzzy sets of a T-S fuzzy fit."""

DUHEM_COMPONENTS = 2
"""Gaussians per branch of a Duhem fit: measured wires need two."""

MOST_FITTED_COMPONENTS = 6
"""The largest number of Gaussians per branch that a user may choose."""


class FitSettings(NamedTuple):
    """The kind of hysteresis model to fit to a record, and its size.

    kind         "tsfuzzy" for a T-S fuzzy Duhem model, "duhem" for a Duhem model
    sets         number of fuzzy sets of a T-S fuzzy model
    memory       number of sets of the last turning point of a T-S fuzzy model; 1: no memory, None: the record decides
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
        """The identified wire: hysteresis model, heat balance, caveats and metrics."""
        fit = self.hysteresis
        sections_c = recorded_sections(fit.path)
        return IdentifiedWire(fit.model, self.thermal.balance, fit.caveats, fit.metrics, sections_c=sections_c)


def identify_hysteresis(v: ArrayLike, y: ArrayLike, settings: FitSettings) -> AnyFit:
    """Fit a hysteresis model with the input v and the output y, both (samples,), and return it with its metrics.

    Raises the errors of `identify_memory` for a T-S fuzzy model, and those of `identify_duhem` for a Duhem model.
    """
    if settings.kind == "duhem":
        return identify_duhem(v, y, components=settings.components)
    return identify_memory(v, y, settings.sets, memory=settings.memory)


def identify_wire(
    record: ExcitationRecord,
    start: HeatBalance,
    settings: FitSettings = STANDARD_FIT,
) -> WireFit:
    """Fit heat balance and hysteresis model to a recorded excitation, and return both fits.

    The search for the heat balance begins at the nominal heat balance `start`. Raises the errors of `identify_thermal`
    and of `identify_hysteresis`.
    """
    thermal = identify_thermal(record, start)
    fit = identify_hysteresis(thermal.wire_temperature_c, record.displacement_mm, settings)
    return WireFit(thermal, fit)
