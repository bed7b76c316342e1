"""An identified wire as a file: the hysteresis model, and in its provenance what else was found: the heat balance, and
what the model must not be trusted in.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, NamedTuple

from smadrive.errors import ModelError
from smadrive.hysteresis import DuhemModel, HysteresisModel, TSFuzzyDuhem, save_model
from smadrive.hysteresis.model_file import Fields, model_text, parse_model, read_model
from smadrive.wire.heat_balance import PARAMETERS, BalanceSource, HeatBalance


class WireFile(NamedTuple):
    """The certified model, the heat balance if the file has one, and what lets doubt the model."""

    model: DuhemModel | TSFuzzyDuhem
    balance: HeatBalance | None
    caveats: tuple[str, ...]


def save_wire(
    path: Path,
    model: HysteresisModel,
    balance: HeatBalance | None,
    figures: Mapping[str, float],
    source: str,
    caveats: Sequence[str] = (),
) -> None:
    """Write the model file with where it comes from, how well it fits and, where known, balance and caveats."""
    provenance: dict[str, Any] = {
        "source": source,
        "identified": datetime.now(UTC).isoformat(timespec="seconds"),
        **figures,
        "caveats": list(caveats),
    }
    if balance is not None:
        provenance["heat_balance"] = asdict(balance)
    save_model(model, path, provenance=provenance)


def load_wire_file(path: Path) -> WireFile:
    """What the file tells of the wire. ModelError, CertificateError."""
    text, place = read_model(path), str(path)
    return WireFile(parse_model(text, place=place), _balance(text, place), _caveats(text, place))


def wire_text(model: HysteresisModel, balance: HeatBalance) -> str:
    """A wire as it is in use, in the form of its file: how a log keeps it."""
    return model_text(model, {"heat_balance": asdict(balance)}, place="wire")


def parse_wire(text: str, place: str) -> tuple[HysteresisModel, HeatBalance]:
    """What `wire_text` wrote. ModelError, CertificateError."""
    model, balance = parse_model(text, place=place), _balance(text, place)
    if balance is None:
        raise ModelError(f"{place}: tells no heat balance; record it again")
    return model, balance


def _balance(text: str, place: str) -> HeatBalance | None:
    """The heat balance in the provenance of a model's text, if it tells one."""
    provenance = _provenance(text, place)
    if provenance is None or provenance.document.get("heat_balance") is None:
        return None
    told = provenance.inner("heat_balance")
    unknown = sorted(told.document.keys() - {*PARAMETERS, "source"})
    if unknown:
        raise ModelError(f"{told.place}: unknown key '{unknown[0]}'; identify the wire again")
    try:
        return HeatBalance(**{name: told.number(name) for name in PARAMETERS}, source=_source(told))
    except ModelError as error:
        message = str(error)
        raise ModelError(message if message.startswith(place) else f"{place}: {message}") from None


def _source(balance: Fields) -> BalanceSource:
    """Where the balance comes from; one without a source was identified."""
    source = balance.document.get("source", BalanceSource.IDENTIFIED.value)
    try:
        return BalanceSource(source)
    except ValueError:
        known = " or ".join(f"'{one}'" for one in BalanceSource)
        raise ModelError(f"{balance.place}: source is {source!r}, it must be {known}") from None


def _caveats(text: str, place: str) -> tuple[str, ...]:
    """What the provenance of a model's text, if it has one, tells against the model."""
    provenance = _provenance(text, place)
    return () if provenance is None or "caveats" not in provenance.document else provenance.texts("caveats")


def _provenance(text: str, place: str) -> Fields | None:
    document = json.loads(text)
    return Fields(place, document).inner("provenance") if "provenance" in document else None
