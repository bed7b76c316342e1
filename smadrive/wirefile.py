"""An identified wire as a file: the hysteresis model, and in its provenance the heat balance that was found with it."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from smadrive.errors import ModelError
from smadrive.hysteresis import DuhemModel, HysteresisModel, TSFuzzyDuhem, load_model, save_model
from smadrive.hysteresis.modelfile import model_text, parse_model
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
    model = load_model(path)
    return model, _balance(path.read_text(encoding="utf-8"), str(path))


def wire_text(model: HysteresisModel, balance: HeatBalance) -> str:
    """A wire as it is in use, in the form of its file: how a log keeps it."""
    return model_text(model, {"heat_balance": asdict(balance)}, place="wire")


def parse_wire(text: str, place: str) -> tuple[HysteresisModel, HeatBalance]:
    """What `wire_text` wrote. ModelError, CertificateError."""
    balance = _balance(text, place)
    if balance is None:
        raise ModelError(f"{place}: tells no heat balance; record it again")
    return parse_model(text, place=place), balance


def _balance(text: str, place: str) -> HeatBalance | None:
    numbers = json.loads(text).get("provenance", {}).get("heat_balance")
    if numbers is None:
        return None
    try:
        return HeatBalance(**numbers)
    except TypeError as error:
        raise ModelError(f"{place}: provenance.heat_balance: {error}; identify the wire again") from None
