"""The rig, the nominal simulated wire and its data sheet, as the settings of a run describe them.

A run changes single keys of a rig file and of a sim file. The changed content is checked like a file, so an unknown key
or an impossible value is found before the campaign starts.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from functools import lru_cache
from math import pi
from pathlib import Path
from typing import Any, NamedTuple, NoReturn

from firmware_sim.config import SimConfig
from firmware_sim.physics.flexinol import AMBIENT_C, DENSITY_KG_PER_M3, flexinol
from smadrive.campaigns.plan.config import RunSettings, WireSettings
from smadrive.campaigns.plan.files import CampaignFiles, RunFile
from smadrive.errors import ConfigError
from smadrive.files.config import validate
from smadrive.files.kinds import RIG, SIM, WIRE
from smadrive.files.shipped import config_file
from smadrive.measurement import DisplacementFrom
from smadrive.rig.config import RigConfig
from smadrive.wire.data_sheet import WireDataSheet

RIG_FILE, SIM_FILE = "in-process", "flexinol-lt-0.15mm"
"""The default rig file and the default sim file of a run."""

RIG_TABLE, SIM_TABLE = "[run.rig]", "[run.sim]"
"""The tables of a campaign file that change a rig file and a sim file, as errors name them."""

SERIAL_NUMBER = 1
"""The serial number of every simulated board. A random number would make two equal runs different."""


class RunDocuments(NamedTuple):
    """The content of the files of one run. `sim` is the nominal wire: `wire.seed` of the run has not changed it yet.

    `profiles` are the files of the profiles, which a worker reads. `excitation_digest` is the SHA-256 of this content
    and of the profiles, without `displacement_from`, which only a tracking run needs. It does not depend on the folder
    of the files.
    """

    rig: RigConfig
    sim: SimConfig
    data_sheet: WireDataSheet
    profiles: tuple[RunFile, ...]
    excitation_digest: str

    def for_excitation(self) -> RunDocuments:
        """Return the documents that the excitation sees: `displacement_from` has its default."""
        return self._replace(rig=self.rig.model_copy(update={"displacement_from": DisplacementFrom.SENSOR}))


class DocumentReader:
    """The documents of the runs of a campaign. Paths are relative to `folder`, the folder of the campaign file."""

    def __init__(self, folder: Path, files: CampaignFiles) -> None:
        self._folder, self._files = folder, files
        self._kept = lru_cache(maxsize=1024)(self._documents)

    def documents_of(self, settings: RunSettings) -> RunDocuments:
        """Return the documents of a run. ConfigError for a missing file, an unknown key and an impossible value."""
        nominal = settings.wire.model_copy(update={"seed": None, "kind": None})
        return self._kept(_text(settings.rig, RIG_TABLE), _text(settings.sim, SIM_TABLE), nominal)

    def _documents(self, rig_text: str, sim_text: str, wire: WireSettings) -> RunDocuments:
        rig, sim = self._rig(json.loads(rig_text)), self._sim(json.loads(sim_text), wire)
        data_sheet = self._data_sheet(wire, sim, rig.wire)
        profiles = tuple(self._files.profile(device.profile) for device in rig.devices)
        return RunDocuments(rig, sim, data_sheet, profiles, self._digest(rig, sim, data_sheet))

    def _digest(self, rig: RigConfig, sim: SimConfig, data_sheet: WireDataSheet) -> str:
        """Return `excitation_digest`. The paths in the rig file are left out: their content stands for them."""
        left_out: Any = {"wire": True, "model": True, "displacement_from": True, "devices": {"__all__": {"profile"}}}
        texts = (
            rig.model_dump_json(exclude=left_out),
            *(self._files.profile_text(device.profile) for device in rig.devices),
            sim.model_dump_json(),
            data_sheet.model_dump_json(),
        )
        return hashlib.sha256("\n".join(texts).encode()).hexdigest()

    def _rig(self, changes: dict[str, Any]) -> RigConfig:
        path = file_path(changes.pop("file", RIG_FILE), self._folder, RIG)
        changed = merged(self._files.toml(path), changes, RIG_TABLE)
        return validate(changed, RigConfig, f"{RIG_TABLE} {path}").in_folder(path.parent)

    def _sim(self, changes: dict[str, Any], wire: WireSettings) -> SimConfig:
        if wire.diameter_mm is None:
            path = file_path(changes.pop("file", SIM_FILE), self._folder, SIM)
            return changed_sim(validate(self._files.toml(path), SimConfig, str(path)), changes)
        if "file" in changes:
            cure = "remove one of the two: `wire.diameter_mm` replaces the sim file"
            raise ConfigError("two wires", where="[run]", value="sim.file and wire.diameter_mm", cure=cure)
        return changed_sim(flexinol(wire.diameter_mm, wire.length_m, wire.alloy), changes)

    def _data_sheet(self, wire: WireSettings, sim: SimConfig, wire_file: str) -> WireDataSheet:
        """Return the data sheet of the wire file of the rig or, with `diameter_mm`, of published data."""
        if wire.diameter_mm is None:
            return self._files.data_sheet(str(config_file(wire_file, WIRE)))
        return _published_data_sheet(wire, wire.diameter_mm, sim)


def changed_sim(sim: SimConfig, changes: Mapping[str, Any]) -> SimConfig:
    """Return the simulated wire with the keys `changes` replaced, and with a fixed serial number."""
    board = {"board": {"serial_number": SERIAL_NUMBER}}
    kept = merged(board, {key: value for key, value in changes.items() if key != "file"}, SIM_TABLE)
    return validate(merged(sim.model_dump(exclude_none=True), kept, SIM_TABLE), SimConfig, SIM_TABLE)


def merged(table: Mapping[str, Any], changes: Mapping[str, Any], where: str) -> dict[str, Any]:
    """Return `table` with `changes`, the content of the table `where`. Tables are merged, other values are replaced.

    The tables in a list are changed by their names. ConfigError for a name that no table of the list has.
    """
    result = dict(table)
    for key, value in changes.items():
        before = result.get(key)
        if isinstance(value, Mapping) and isinstance(before, Mapping):
            result[key] = merged(before, value, f"{where} {key}")
        elif isinstance(value, Mapping) and isinstance(before, list | tuple):
            result[key] = _merged_by_name(before, value, f"{where} {key}")
        else:
            result[key] = value
    return result


def _merged_by_name(tables: list[Any] | tuple[Any, ...], changes: Mapping[str, Any], where: str) -> list[Any]:
    """Return the list of named tables, each merged with the changes under its name."""
    names = [_name_of(table) for table in tables]
    for name, change in changes.items():
        if name not in names:
            cure = f"write one of {', '.join(filter(None, names))}" if any(names) else "write a list"
            raise ConfigError("no table has this name", where=where, value=name, cure=cure)
        if not isinstance(change, Mapping):
            cure = f"name the key of '{name}' to change, such as {name}.profile"
            raise ConfigError("not a table", where=f"{where}: {name}", value=str(change), cure=cure)
    return [
        merged(table, changes[name], f"{where} {name}") if name is not None and name in changes else table
        for name, table in zip(names, tables, strict=True)
    ]


def _name_of(table: Any) -> str | None:
    name = table.get("name") if isinstance(table, Mapping) else None
    return name if isinstance(name, str) else None


def _text(changes: Mapping[str, Any], where: str) -> str:
    """Return the changes as JSON. ConfigError for a date or a time: TOML has them, JSON and these files do not."""

    def refuse(value: object) -> NoReturn:
        cure = "write a number, a text in quotes, or a table"
        raise ConfigError("dates and times have no meaning here", where=where, value=str(value), cure=cure)

    return json.dumps(changes, sort_keys=True, default=refuse)


def _published_data_sheet(wire: WireSettings, diameter_mm: float, sim: SimConfig) -> WireDataSheet:
    diameter_m, heat = 1e-3 * diameter_mm, sim.wire
    mass_kg = DENSITY_KG_PER_M3 * 0.25 * pi * diameter_m**2 * wire.length_m
    values = {
        "name": f"Flexinol {wire.alloy} {diameter_mm:g} mm x {1e3 * wire.length_m:g} mm",
        "diameter_mm": diameter_mm,
        "length_mm": 1e3 * wire.length_m,
        "resistance_ohm_per_m": heat.resistance_cold_ohm / wire.length_m,
        "resistance_change": heat.resistance_change,
        "density_kg_per_m3": DENSITY_KG_PER_M3,
        "specific_heat_j_per_kg_k": heat.heat_capacity_j_per_k / mass_kg,
        "latent_heat_j_per_kg": heat.latent_heat_j_per_kg,
        "convection_w_per_m2_k": heat.loss_w_per_k / (pi * diameter_m * wire.length_m),
        "ambient_c": AMBIENT_C,
        "thermocouple_lag_s": sim.thermocouple.lag_s,
    }
    return validate(values, WireDataSheet, f"the data sheet of the wire of {SIM_TABLE} and [run.wire]")


def file_path(name: str, folder: Path, kind: Any) -> Path:
    """Return the path of a file: relative to `folder` if `name` ends in .toml, otherwise of the shipped file `name`."""
    if not isinstance(name, str):
        raise ConfigError(
            "not the name of a file", where="file", value=str(name), cure='write a text: file = "RIG.toml"'
        )
    return config_file(str(folder / name) if name.endswith(".toml") else name, kind)
