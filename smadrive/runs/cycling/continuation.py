"""The rest of a cycling run that ended early, from the log of the previous part.

The log of the previous part stays unchanged. The continuation writes a log of its own.
"""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from smadrive.control.references.reference import Reference
from smadrive.errors import ConfigError, DataError
from smadrive.measurement import DisplacementFrom
from smadrive.rig.config import RigConfig
from smadrive.rig.rig import Rig
from smadrive.runs.comparison.settings import flat
from smadrive.runs.cycling.cycles import Cycling, cycles_of, cycling_of
from smadrive.runs.log.reader import Log, read_log
from smadrive.runs.run_log import WIRE_FILE
from smadrive.runs.run_metadata import displacement_source_of, reference_of, rig_config_of, wire_of
from smadrive.wire.identified_wire import IdentifiedWire

MOST_SHOWN = 2
"""The largest number of changes of the rig file that a warning names."""

MOST_CHARACTERS = 40
"""Largest number of characters of a value in the warning about a changed rig file."""


class Continuation(NamedTuple):
    """The data for the rest of a cycling run. `reference` is one cycle, without the approach.

    `caveats` has a warning for each difference from the previous part: of the rig file, and of the source of the
    displacement. `displacement_from` is None if no source was chosen, and the log names none, or the source of
    the rig file.
    """

    reference: Reference
    wire: IdentifiedWire
    cycling: Cycling
    caveats: tuple[str, ...]
    displacement_from: DisplacementFrom | None


def continuation_of(path: Path, config: RigConfig, chosen: DisplacementFrom | None = None) -> Continuation:
    """Return the rest of the run in the log at `path`, for the rig `config`.

    `chosen` is the source of the displacement, instead of the source in the log. DataError when the run repeats no
    reference, or all its cycles are done; ConfigError for a rig with another wire.
    """
    log = read_log(path)
    cycling = cycling_of(log)
    if cycling is None:
        cure = "give the log of a run with --repeat"
        raise DataError("the run repeats no reference, so it has no cycles to continue", where=path, cure=cure)
    done = cycles_of(log)
    if len(done) >= cycling.total:
        cure = "start a new run with --reference and --repeat"
        raise DataError("all cycles are done", where=path, value=len(done), limit=cycling.total, cure=cure)
    _check_wire(log, config)
    rest = Cycling(cycling.total, tuple(done), str(path))
    wire = wire_of(log)
    if WIRE_FILE in log.metadata:
        wire = replace(wire, source=log.metadata[WIRE_FILE])
    before = displacement_source_of(log)
    caveats = *_differences(log, config), *_source_caveats(path, before, chosen)
    kept = None if before is config.displacement_from else before
    return Continuation(one_cycle(reference_of(log)), wire, rest, caveats, chosen or kept)


def one_cycle(reference: Reference) -> Reference:
    """Return one cycle of the reference, without the approach."""
    is_scored = reference.times_s >= reference.scored_from_s
    return Reference.from_samples(reference.times_s[is_scored], reference.displacement_mm[is_scored])


def _check_wire(log: Log, config: RigConfig) -> None:
    before = rig_config_of(log)
    if Path(before.wire).name != Path(config.wire).name:
        raise ConfigError(
            "the rig has another wire than the run to resume",
            where=f"rig '{config.name}'",
            value=f"{config.wire}, the run had {before.wire}",
            cure="give the rig of that run",
        )


def _differences(log: Log, config: RigConfig) -> tuple[str, ...]:
    """Return one warning if the rig file has changed since the run in `log`, otherwise an empty tuple."""
    now = dict(flat(json.loads(config.model_dump_json())))
    before = dict(flat(log.json("rig")))
    names = [name for name in {**before, **now} if now.get(name) != before.get(name)]
    texts = [f"{name} was {_shown(before.get(name))}, is {_shown(now.get(name))}" for name in names]
    if not texts:
        return ()
    if np.isfinite(log.column_with_gaps("displacement_mm")).any() and not Rig(config).measures("displacement"):
        texts.insert(0, "no device measures the displacement now")
    more = [f"and {len(texts) - MOST_SHOWN} more"] if len(texts) > MOST_SHOWN else []
    changes = "; ".join([*texts[:MOST_SHOWN], *more])
    return (f"the rig file has changed since {log.path.name}: {changes}. Press Ctrl-C if this is the wrong rig",)


def _source_caveats(path: Path, before: DisplacementFrom | None, chosen: DisplacementFrom | None) -> tuple[str, ...]:
    """Return one warning if another source of the displacement was chosen than before, otherwise an empty tuple."""
    if None in (before, chosen) or before is chosen:
        return ()
    change = f'displacement_from is "{chosen}", in {path.name} it was "{before}"'
    return (f"{change}: the errors of the earlier and the later cycles cannot be compared",)


def _shown(value: str | None) -> str:
    return "not set" if value is None else value if len(value) <= MOST_CHARACTERS else f"{value[:MOST_CHARACTERS]}…"
