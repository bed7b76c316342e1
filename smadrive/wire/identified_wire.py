"""An identified wire: hysteresis model, heat balance, resistance, caveats, and its file.

The file is a model file. Its provenance holds the heat balance, the resistance, the caveats and the origin.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from smadrive.display.ascii_text import ascii_text
from smadrive.display.card import card
from smadrive.errors import ModelError
from smadrive.files.json_fields import Fields
from smadrive.hysteresis import IdentifiedModel, save_model
from smadrive.hysteresis.model import loop_plot
from smadrive.hysteresis.model_file import model_text, parse_model, read_model
from smadrive.wire.heat_balance import PARAMETERS, BalanceSource, HeatBalance
from smadrive.wire.identified_resistance import NUMBERS, SPLINE, WireResistance
from smadrive.wire.recorded_loops import Sections
from smadrive.wire.wire_model import WireModel, travel_mm

_SECTION_KEYS = ("turning_points_c", "ends_c")

ADDED = ("thermocouple_noise_c",)
"""Parameters of the heat balance that the files of older versions lack."""

METRICS = ("rms_percent", "max_percent")
"""The names of the errors of a fit."""

SAME, SAME_CHANGE = 0.1, 0.08
"""Largest differences between the resistance of the heat balance and the identified resistance, as shares: of the cold
or hot wire, and of the change over the stroke. Both are fitted to the same record."""


@dataclass(frozen=True, repr=False)
class IdentifiedWire:
    """An identified wire.

    model          certified hysteresis model, from wire temperature in °C to displacement in mm
    heat_balance   heat balance; None if the record had only temperatures and displacements
    caveats        reasons to distrust the model, one sentence each
    metrics        errors of the fit in % of the span (see METRICS); empty if they are unknown
    source         path of the record from which it was identified, or of the file from which it was loaded
    sections_c     sections of the record, as (turning point, end) in °C; empty if they are unknown
    resistance     resistance over temperature and phase; None if it was not identified
    """

    model: IdentifiedModel
    heat_balance: HeatBalance | None = None
    caveats: tuple[str, ...] = ()
    metrics: Mapping[str, float] = field(default_factory=dict)
    source: str = ""
    sections_c: Sections = ()
    resistance: WireResistance | None = None

    def facts(self) -> list[tuple[str, str]]:
        """Return the main properties of the wire for display, as pairs of a name and a text with its unit."""
        low_c, high_c = self.model.input_range
        facts = [
            self.model.facts()[0],
            ("identified", f"from {low_c:.4g} to {high_c:.4g} °C"),
            ("stroke", f"{travel_mm(self.model).stroke_mm:.3g} mm"),
        ]
        if "rms_percent" in self.metrics:
            facts.append(("RMS error of the fit", f"{self.metrics['rms_percent']:.2f} % of the span"))
        facts.append(self.model.facts()[-1])
        if self.heat_balance is None:
            return [*facts, ("heat balance", "not identified: the heat balance of the data sheet is used")]
        return [
            *facts,
            ("time constant", f"{self.heat_balance.time_constant_s:.2f} s"),
            ("latent heat", f"{self.heat_balance.latent_heat_j:.3g} J"),
            ("cold resistance", f"{self.heat_balance.resistance_cold_ohm:.3g} Ω"),
            ("displacement by resistance", "not identified" if self.resistance is None else "identified"),
        ]

    def __repr__(self) -> str:
        facts = (f"{name} {value}" for name, value in self.facts())
        warnings = (f"warning: {caveat}" for caveat in self.caveats)
        return ascii_text(f"{type(self).__name__}({', '.join((*facts, *warnings))})")

    def _repr_html_(self) -> str:
        title = f"Identified wire, from {Path(self.source).name}" if self.source else "Identified wire"
        plot = loop_plot(self.model, "wire temperature / °C", "displacement / mm")
        return card(title, self.facts(), plot, self.caveats)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the wire to a file, with the time of writing.

        ModelError for a model without a file format, DataError when the file cannot be written.
        """
        provenance: dict[str, Any] = {
            "source": self.source,
            "identified": datetime.now(UTC).isoformat(timespec="seconds"),
            **self.metrics,
            "caveats": list(self.caveats),
            **self._parts(),
        }
        save_model(self.model, path, provenance=provenance)

    def text(self) -> str:
        """Return the identified parts of the wire as text, in the format of a wire's file, as a log contains it."""
        return model_text(self.model, self._parts(), place="wire")

    def _parts(self) -> dict[str, Any]:
        """Return what is known of heat balance, resistance and sections, as a wire's file contains it."""
        parts: dict[str, Any] = {}
        if self.heat_balance is not None:
            parts["heat_balance"] = asdict(self.heat_balance)
        if self.resistance is not None:
            parts["resistance"] = asdict(self.resistance)
        if self.sections_c:
            parts["sections"] = dict(zip(_SECTION_KEYS, zip(*self.sections_c, strict=True), strict=True))
        return parts

    @classmethod
    def of(cls, wire: WireModel) -> IdentifiedWire:
        """Return the wire of which `wire` is the model."""
        return cls(wire.model, wire.balance, resistance=wire.resistance)

    def wire_model(self, otherwise: HeatBalance | None = None) -> WireModel:
        """Return the model that steps temperature and displacement together.

        `otherwise` is the heat balance of a wire without its own. ModelError without any heat balance.
        """
        balance = self.heat_balance or otherwise
        if balance is None:
            raise ModelError(
                "no heat balance",
                where=self.source or "wire",
                cure="identify the wire from a log with current and voltage",
            )
        return WireModel(self.model, balance, self.resistance)


def load_wire(path: str | os.PathLike[str]) -> IdentifiedWire:
    """Return the wire in a file. ModelError for an unusable file, CertificateError for an uncertified model."""
    return parse_wire(read_model(Path(path)), str(path))


def parse_wire(text: str, place: str) -> IdentifiedWire:
    """Return the wire in `text`, the content of a file or log. Raises the errors of `load_wire`; they name `place`."""
    model, provenance = parse_model(text, place=place), _provenance(text, place)
    if provenance is None:
        return IdentifiedWire(model, source=place)
    balance, caveats, sections_c = _heat_balance(provenance, place), _caveats(provenance), _sections(provenance)
    resistance = _resistance(provenance, place, balance)
    metrics = {name: provenance.number(name) for name in METRICS if name in provenance.document}
    return IdentifiedWire(model, balance, caveats, metrics, place, sections_c, resistance)


def _provenance(text: str, place: str) -> Fields | None:
    document = json.loads(text)
    return Fields(place, document).inner("provenance") if "provenance" in document else None


def _caveats(provenance: Fields) -> tuple[str, ...]:
    return provenance.texts("caveats") if "caveats" in provenance.document else ()


def _sections(provenance: Fields) -> Sections:
    """Return the sections of the record; none in a file of an older version."""
    if "sections" not in provenance.document:
        return ()
    sections = provenance.inner("sections")
    turns, ends = (sections.numbers(key) for key in _SECTION_KEYS)
    if len(turns) != len(ends):
        raise ModelError("one number per turning point is needed", where=f"{sections.place}: {_SECTION_KEYS[1]}")
    return tuple(zip(turns, ends, strict=True))


def _heat_balance(provenance: Fields, place: str) -> HeatBalance | None:
    """Return the heat balance in the provenance, or None if it contains no heat balance."""
    if provenance.document.get("heat_balance") is None:
        return None
    parameters = provenance.inner("heat_balance")
    unknown = sorted(parameters.document.keys() - {*PARAMETERS, "source"})
    if unknown:
        raise ModelError("unknown key", where=f"{parameters.place}: {unknown[0]}", cure="identify the wire again")
    try:
        names = [name for name in PARAMETERS if name in parameters.document or name not in ADDED]
        return HeatBalance(**{name: parameters.number(name) for name in names}, source=_source(parameters))
    except ModelError as error:
        if not error.where.startswith(place):
            error.where = f"{place}: {error.where}"
        raise


def _resistance(provenance: Fields, place: str, balance: HeatBalance | None) -> WireResistance | None:
    """Return the resistance in the provenance, or None if it contains no resistance.

    ModelError if it cannot belong to a wire with this heat balance.
    """
    if provenance.document.get("resistance") is None:
        return None
    parameters = provenance.inner("resistance")
    values: dict[str, Any] = {name: parameters.number(name) for name in NUMBERS}
    values |= {name: parameters.numbers(name) for name in SPLINE}
    try:
        resistance = WireResistance(**values)
        check_resistance(resistance, balance)
    except ModelError as error:
        error.where = f"{place}: {error.where}"
        raise
    return resistance


def check_resistance(resistance: WireResistance, balance: HeatBalance | None) -> None:
    """Raise ModelError if this cannot be the resistance of a wire, or of a wire with this heat balance."""
    resistance.check_change()
    if balance is not None:
        _check_same("cold", resistance.ohm(balance.ambient_c, 0.0), balance.resistance_ohm(0.0))
        _check_same("hot", resistance.ohm(resistance.nodes_c[-1], 1.0), balance.resistance_ohm(1.0))
        _check_change(resistance, balance)


def _check_same(state: str, ohm: float, balance_ohm: float) -> None:
    """Raise ModelError if two resistances of the wire in one state differ by more than `SAME`."""
    if abs(ohm - balance_ohm) > SAME * balance_ohm:
        what = f"the resistance of the {state} wire is not that of the heat balance"
        limit = f"{balance_ohm:.4g} Ω ± {100 * SAME:g} %"
        raise ModelError(what, where="resistance", value=f"{ohm:.4g} Ω", limit=limit, cure="identify the wire again")


def _check_change(resistance: WireResistance, balance: HeatBalance) -> None:
    """Raise ModelError if two changes of the resistance over the stroke differ by more than `SAME_CHANGE`."""
    middle_c = 0.5 * (resistance.nodes_c[0] + resistance.nodes_c[-1])
    change = resistance.ohm(middle_c, 1.0) / resistance.ohm(middle_c, 0.0) - 1.0
    if abs(change - balance.resistance_change) > SAME_CHANGE:
        what = "the change of the resistance over the stroke is not that of the heat balance"
        value, limit = f"{100 * change:+.3g} %", f"{100 * balance.resistance_change:+.3g} ± {100 * SAME_CHANGE:g} %"
        raise ModelError(what, where="resistance", value=value, limit=limit, cure="identify the wire again")


def _source(parameters: Fields) -> BalanceSource:
    """Return the origin of a heat balance in a file. A heat balance without a source counts as identified."""
    source = parameters.document.get("source", BalanceSource.IDENTIFIED.value)
    try:
        return BalanceSource(source)
    except ValueError:
        sources = ", ".join(f"'{one}'" for one in BalanceSource)
        raise ModelError(
            "unknown source", where=f"{parameters.place}: source", value=f"{source!r}", cure=f"write one of {sources}"
        ) from None
