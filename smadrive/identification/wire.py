"""Identification of a wire from one recorded excitation: its heat balance, its hysteresis, then its resistance.

The order matters. The thermocouple lags the wire by about 0.1 s, which at a few K/s is several tenths of a kelvin. In
the middle of the loop 1 K is 5 to 7 % of the stroke. So a hysteresis model that is fitted to the reading would have
too wide a loop. The thermal fit comes first, and the hysteresis model is fitted to the temperature of the wire itself.
The resistance depends on this temperature and on the phase. The hysteresis model gives the cold and the hot end of the
phase. If the resistance is not usable, the identified wire has none.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, NamedTuple, Self

from numpy.typing import ArrayLike

from smadrive.errors import ConfigError, IdentificationError, ModelError
from smadrive.files.spelling import suggestion_or_list
from smadrive.hysteresis import DuhemModel, TSFuzzyDuhem, TSFuzzyPreisach
from smadrive.identification.duhem import identify_duhem
from smadrive.identification.excitation import ExcitationRecord
from smadrive.identification.memory.candidates import check_memory
from smadrive.identification.memory.fit import MemoryFit, identify_memory
from smadrive.identification.quality.metrics import Fit
from smadrive.identification.resistance_fit.fit import ResistanceFit, identify_resistance
from smadrive.identification.thermal_fit.fit import ThermalFit, identify_thermal
from smadrive.identification.tsfuzzy.fit import FUZZY_SETS
from smadrive.numerics.scalars import whole_number
from smadrive.wire.heat_balance import HeatBalance
from smadrive.wire.identified_wire import IdentifiedWire, check_resistance
from smadrive.wire.recorded_loops import recorded_sections
from smadrive.wire.wire_model import WireModel

Kind = Literal["tsfuzzy", "duhem"]
MODELS: dict[Kind, str] = {"tsfuzzy": "T-S fuzzy", "duhem": "Duhem"}
"""The model of each kind in messages."""
OWNERS: dict[str, Kind] = {"sets": "tsfuzzy", "memory": "tsfuzzy", "components": "duhem"}
"""The kind of model that has each setting."""

AnyFit = Fit[TSFuzzyDuhem] | Fit[TSFuzzyPreisach] | Fit[DuhemModel] | MemoryFit


SETS = (3, 50)
"""The smallest and the largest number of fuzzy sets of a T-S fuzzy fit."""
COMPONENTS = (1, 6)
"""The smallest and the largest number of Gaussians per branch of a Duhem fit."""
DUHEM_COMPONENTS = 2
"""The standard number of Gaussians per branch: measured wires need two."""


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

    @classmethod
    def of(cls, kind: Kind, sets: int | None, memory: int | None, components: int | None, prefix: str = "") -> Self:
        """Return the settings that a user has chosen. None stands for a setting that the user has left out.

        ConfigError for an unknown kind, for a setting that the kind does not have, and for a number outside its limits.
        `prefix` precedes the names of the settings in these errors: "--" for the options of a command.
        """
        if kind not in MODELS:
            cure = suggestion_or_list(str(kind), tuple(MODELS))
            raise ConfigError("unknown", where=f"{prefix}kind", value=repr(kind), cure=cure)
        given = {"sets": sets, "memory": memory, "components": components}
        for name, value in given.items():
            if value is not None and kind != OWNERS[name]:
                owner = OWNERS[name]
                what, cure = f"only a {MODELS[owner]} model has this", f"leave it out, or choose the kind {owner}"
                raise ConfigError(what, where=f"{prefix}{name}", value=value, cure=cure)
        if sets is not None:
            whole_number(sets, f"{prefix}sets", "fuzzy sets", *SETS)
        if memory is not None:
            check_memory(memory, ConfigError, f"{prefix}memory")
        if components is not None:
            whole_number(components, f"{prefix}components", "Gaussians per branch", *COMPONENTS)
        return cls(kind, sets or FUZZY_SETS, memory, components or DUHEM_COMPONENTS)


STANDARD_FIT = FitSettings()


@dataclass(frozen=True)
class WireFit:
    """The thermal fit, the hysteresis fit and the resistance fit of one record.

    `resistance` is None if the resistance cannot measure the displacement; `without_resistance` is then the reason.
    """

    thermal: ThermalFit
    hysteresis: AnyFit
    resistance: ResistanceFit | None
    without_resistance: str = ""

    @property
    def wire(self) -> IdentifiedWire:
        """The identified wire: hysteresis model, heat balance, resistance, caveats and metrics."""
        fit = self.hysteresis
        sections_c = recorded_sections(fit.path)
        resistance = None if self.resistance is None else self.resistance.resistance
        return IdentifiedWire(
            fit.model,
            self.thermal.balance,
            fit.caveats,
            fit.metrics,
            sections_c=sections_c,
            resistance=resistance,
        )


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
    """Fit heat balance, hysteresis model and resistance to a recorded excitation, and return the fits.

    The search for the heat balance begins at the nominal heat balance `start`. Raises the errors of `identify_thermal`
    and of `identify_hysteresis`.
    """
    thermal = identify_thermal(record, start)
    fit = identify_hysteresis(thermal.wire_temperature_c, record.displacement_mm, settings)
    try:
        wire = WireModel(fit.model, thermal.balance)
        found = identify_resistance(record, thermal.wire_temperature_c, wire)
        check_resistance(found.resistance, thermal.balance)
    except (IdentificationError, ModelError) as error:
        return WireFit(thermal, fit, None, f"{error.what} ({error.value}){error.cure and f': {error.cure}'}")
    return WireFit(thermal, fit, found)
