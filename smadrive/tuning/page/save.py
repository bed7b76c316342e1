"""Saves a tuning: a new model file, and a new rig file that names the model. No existing file is overwritten."""

from __future__ import annotations

import json
import re
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import tomlkit

from smadrive.errors import ConfigError
from smadrive.files.atomic import replacing
from smadrive.rig.config import load_rig, path_or_name

_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,60}")


def save_tuning(folder: Path, name: str, rig_file: Path, status: dict[str, Any]) -> tuple[Path, Path]:
    """Write the tuning in force to NAME.json (model) and NAME.toml (rig) in `folder`, and return the two paths.

    `status` is the published status, which holds the tuning. ConfigError when the name is invalid, when one of the new
    files exists already, or when the rig file cannot be loaded. DataError when a file cannot be written; then neither
    of the new files is left.
    """
    if not name:
        raise ConfigError("the new files have no name", cure="type a name into the field beside Save")
    if not _NAME.fullmatch(name):
        cure = "begin with a letter or digit; use at most 61 letters, digits, '.', '-' and '_'"
        raise ConfigError("invalid file name", value=f"'{name}'", cure=cure)
    model_file, new_rig_file = folder / f"{name}.json", folder / f"{name}.toml"
    for path in (model_file, new_rig_file):
        if path.exists():
            raise ConfigError("the file exists already", where=path, cure="choose another name")
    tuning, saved = status["tuning"], datetime.now(UTC).isoformat(timespec="seconds")
    source = f"tuned on rig '{status['rig']}', {saved}; last change: {tuning['change']}"
    metadata = {"source": source, "caveats": tuning["caveats"], "events": [text for _, text in status["events"]]}
    model_text = _model_text(tuning["wire"], metadata)
    rig_text = _rig_text(rig_file, model_file, tuning, source)
    _write(model_file, model_text)
    try:
        _write(new_rig_file, rig_text)
    except BaseException:
        model_file.unlink(missing_ok=True)
        raise
    return model_file, new_rig_file


def _model_text(wire: str, metadata: dict[str, Any]) -> str:
    document = json.loads(wire)
    document["provenance"] = {**metadata, **document["provenance"]}
    return json.dumps(document, indent=2, allow_nan=False) + "\n"


def _rig_text(rig_file: Path, model_file: Path, tuning: dict[str, Any], source: str) -> str:
    """Return the text of the old rig file, including comments, with the new model, feedback and displacement source.

    Paths of the wire and of the device profiles are adapted to the folder of the new rig file.
    """
    try:
        before = load_rig(str(rig_file))
    except ConfigError as error:
        raise ConfigError(
            f"the rig file cannot be loaded any more: {error.what}",
            where=rig_file,
            value=error.value,
            limit=error.limit,
            cure="restore the rig file, then save again",
        ) from None
    document = tomlkit.parse(rig_file.read_text(encoding="utf-8-sig"))
    document["model"] = model_file.name
    if tuning["displacement_from"] != before.displacement_from:
        document["displacement_from"] = tuning["displacement_from"]
    folder = rig_file.parent.resolve()
    if folder != model_file.parent.resolve():
        document["wire"] = path_or_name(folder, document["wire"])
        for device in document["devices"]:
            device["profile"] = path_or_name(folder, device["profile"])
    section = document.setdefault("feedback", tomlkit.table())
    for key, value in tuning["feedback"].items():
        section[key] = value
    return f"# {source}\n" + tomlkit.dumps(document)


def _write(path: Path, text: str) -> None:
    with replacing(path) as partial:
        partial.write_text(text, encoding="utf-8")
