"""The settings of a run as a dict from name to text, and the settings in which runs differ."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from typing import Any
from zlib import crc32

import numpy as np

from smadrive.control.controllers.feedback import PIGains
from smadrive.control.references.reference import Reference
from smadrive.rig.controllers import EXCITATION_SLOWER
from smadrive.runs.log.reader import Log
from smadrive.runs.run_kind import RunKind
from smadrive.runs.run_metadata import excitation_of, nominal_balance, reference_of, rig_config_of, wire_of
from smadrive.wire.wire_model import travel_mm

MOST_VALUES = 8
"""If models differ in more values than this, only the number of these values is shown."""

MODEL = "model: "
BALANCE = "heat balance: "
"""The names of the values of a model, and of its heat balance, begin with these texts."""

PLAIN = ("inverse", "controller", "displacement_from", "seed", "machine")
"""Names of the metadata texts that are shown as settings without a change."""


CHECKSUM = "checksum of the reference"
"""The name of the setting that differs for any two different references. Their approaches do not count."""


def differing_settings(logs: Sequence[Log]) -> dict[str, tuple[str, ...]]:
    """Return the settings in which the runs differ, by name, with one text for each run.

    The text is empty if the run does not have the setting.
    """
    found = [settings_of(log) for log in logs]
    names = dict.fromkeys(name for settings in found for name in settings)
    rows = {name: tuple(settings.get(name, "") for settings in found) for name in names}
    return counted(
        {name: texts for name, texts in rows.items() if len(set(texts)) > 1 and not _is_follow_up(name, texts)}
    )


def _is_follow_up(name: str, texts: Sequence[str]) -> bool:
    """Return True if `name` is a value of models, and one of the models lacks it (an empty text in `texts`).

    The setting `model` already shows that the models differ.
    """
    return name.startswith((MODEL, BALANCE)) and "" in texts


def settings_of(log: Log) -> dict[str, str]:
    """Return every setting of the run: name to text. DataError when the metadata are invalid."""
    return dict(_settings(log))


def flat(value: Any, key: str = "") -> Iterator[tuple[str, str]]:
    """Yield (path, JSON text) for each value in a tree of JSON objects.

    A path is for example `limits.current_max_a`. A list without objects is one value.
    """
    if isinstance(value, dict):
        for name, inner in value.items():
            yield from flat(inner, f"{key}.{name}" if key else name)
    elif isinstance(value, list) and any(isinstance(inner, dict) for inner in value):
        for number, inner in enumerate(value):
            yield from flat(inner, f"{key}[{number}]")
    else:
        yield key, json.dumps(value, ensure_ascii=False)


def set_values(value: Any) -> Iterator[tuple[str, str]]:
    """Yield (path, JSON text) like `flat`, without the values that are null."""
    return ((name, text) for name, text in flat(value) if text != "null")


def _settings(log: Log) -> Iterator[tuple[str, str]]:
    yield "kind of run", log.kind.value
    yield from _experiment(log)
    yield from _gains(log)
    yield from ((f"rig: {name}", text) for name, text in _plain(log.json("rig")))
    if "data_sheet" in log.metadata:
        yield from ((f"wire file: {name}", text) for name, text in _plain(log.json("data_sheet")))
    if "wire" in log.metadata:
        yield from _wire(log)
    for name in ("devices", "versions"):
        yield from ((f"{name}: {part}", text) for part, text in _plain(log.json(name)))
    for device, profile in log.json("profiles").items():
        text = json.dumps(profile, sort_keys=True)
        yield f"profile of {device}", f"{profile['profile']['id']}, checksum {crc32(text.encode()):08x}"
    yield from ((name, log.metadata[name]) for name in PLAIN if name in log.metadata)


def _experiment(log: Log) -> Iterator[tuple[str, str]]:
    """Yield (name, text) for reference, excitation or step. The path from the first state of the wire is left out."""
    if "reference" in log.metadata:
        yield from _reference(reference_of(log))
    if "excitation" in log.metadata:
        excitation = excitation_of(log)
        points = excitation.turning_points_c[1:]
        span = f"{min(points):g} to {max(points):g} °C at {excitation.rate_c_per_s:g} K/s"
        yield "excitation", f"{span}, {len(points)} turning points"
    if "step" in log.metadata:
        yield from ((f"step: {name}", text) for name, text in _plain(log.json("step")))


def _plain(value: Any) -> Iterator[tuple[str, str]]:
    """Yield (path, text) like `set_values`, but texts without quotation marks and floats with five digits."""
    for name, text in set_values(value):
        inner = json.loads(text)
        yield name, f"{inner:.5g}" if isinstance(inner, float) else inner if isinstance(inner, str) else text


def _reference(reference: Reference) -> Iterator[tuple[str, str]]:
    is_scored = reference.times_s >= reference.scored_from_s
    times_s = reference.times_s[is_scored] - reference.scored_from_s
    displacement_mm = reference.displacement_mm[is_scored]
    samples = np.round(np.stack((times_s, displacement_mm)), 6) + 0.0  # no negative zero
    span = f"{displacement_mm.min():.4g} to {displacement_mm.max():.4g} mm"
    yield "reference", f"{span}, {times_s[-1]:.4g} s"
    yield CHECKSUM, f"{crc32(samples.tobytes()):08x}"


def _gains(log: Log) -> Iterator[tuple[str, str]]:
    """Yield (name, text) of the gains of the temperature loop, computed from the rig file and the heat balance."""
    if log.kind not in (RunKind.TRACKING, RunKind.EXCITATION, RunKind.STEP):
        return
    is_identified = log.kind is RunKind.TRACKING
    balance = (wire_of(log).heat_balance if is_identified else None) or nominal_balance(log)
    feedback = rig_config_of(log).feedback
    slower = 1.0 if is_identified else EXCITATION_SLOWER
    gains = PIGains.for_balance(balance, slower * feedback.closed_loop_s, feedback.integral_s)
    yield "gain Kp", f"{gains.proportional_w_per_k:.4g} W/K"
    yield "gain Ki", f"{gains.integral_w_per_k_s:.4g} W/(K s)"


def _wire(log: Log) -> Iterator[tuple[str, str]]:
    model = wire_of(log).model
    yield "model", type(model).__name__
    yield "model's stroke", f"{travel_mm(model).stroke_mm:.4g} mm"
    document = log.json("wire")
    balance = document.pop("provenance", {}).get("heat_balance") or {}
    yield from ((f"{BALANCE}{name}", text) for name, text in _plain(balance))
    yield from ((f"{MODEL}{name}", text) for name, text in flat(document))


def counted(rows: dict[str, tuple[str, ...]]) -> dict[str, tuple[str, ...]]:
    """Return `rows`, but replace the rows of model values by a single row if there are more than `MOST_VALUES`.

    This row holds for each run the number of model values that differ from the first run, as text.
    """
    of_models = [texts for name, texts in rows.items() if name.startswith(MODEL)]
    if len(of_models) <= MOST_VALUES:
        return rows
    counts = [sum(texts[run] != texts[0] for texts in of_models) for run in range(len(of_models[0]))]
    others = {name: texts for name, texts in rows.items() if not name.startswith(MODEL)}
    return {**others, "values of the model": tuple(_count_text(count) for count in counts)}


def _count_text(count: int) -> str:
    """Return `count`, the number of values that differ from the first run, as text."""
    return f"{count} differ from the first run" if count else "same as the first run"
