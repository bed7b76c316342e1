"""An identified wire as a file: the hysteresis model, and in its provenance the heat balance that was found with it."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, fields
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from smadrive.errors import ModelError
from smadrive.hysteresis import DuhemModel, HysteresisModel, TSFuzzyDuhem, save_model
from smadrive.hysteresis.modelfile import Fields, model_text, parse_model, read_model
from smadrive.thermal import HeatBalance


def save_wire(
    path: Path, model: HysteresisModel, balance: HeatBalance | None, figures: Mapping[str, float], source: str
) -> None:
    """Write the model file with where it comes from, how well it fits and, where known, the heat balance."""
    provenance: dict[str, Any] = {
        "source": source,
        "identified": datetime.now(UTC).isoformat(timespec="seconds"),
        **figures,
    }
    if balance is not None:
        provenance["heat_balance"] = asdict(balance)
    save_model(model, path, provenance=provenance)


def load_wire_file(path: Path) -> tuple[DuhemModel | TSFuzzyDuhem, HeatBalance | None]:
    """The certified model of the file, and its heat balance if it has one. ModelError, CertificateError."""
    text = read_model(path)
    return parse_model(text, place=str(path)), _balance(text, str(path))


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
    document = json.loads(text)
    if "provenance" not in document:
        return None
    provenance = Fields(place, document).inner("provenance")
    if provenance.document.get("heat_balance") is None:
        return None
    told = provenance.inner("heat_balance")
    names = [field.name for field in fields(HeatBalance)]
    unknown = sorted(told.document.keys() - names)
    if unknown:
        raise ModelError(f"{told.place}: unknown key '{unknown[0]}'; identify the wire again")
    try:
        return HeatBalance(**{name: told.number(name) for name in names})
    except ModelError as error:
        message = str(error)
        raise ModelError(message if message.startswith(place) else f"{place}: {message}") from None
