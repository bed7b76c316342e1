"""The runs of a campaign, in their order, with the files that they read.

The last axis varies fastest, and the first axis slowest. So runs of one wire follow each other if the wire is the first
axis. The number of a run is its place in this order, counted from 0. The table of results is sorted by this number.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from math import prod
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from smadrive.campaigns.plan.axes import Axis, Level, axes_of
from smadrive.campaigns.plan.checks import check_seeds, check_settings
from smadrive.campaigns.plan.config import (
    MAIN_METRICS,
    NO_DISTURBANCE,
    CampaignConfig,
    DisturbanceConfig,
    ReferenceConfig,
    RunSettings,
    load_campaign,
)
from smadrive.campaigns.plan.documents import DocumentReader, RunDocuments, merged
from smadrive.campaigns.plan.files import CampaignFiles, RunFile, check_name, opened
from smadrive.errors import ConfigError
from smadrive.files.config import validate
from smadrive.files.kinds import CAMPAIGN
from smadrive.files.shipped import config_file
from smadrive.files.spelling import suggestion_or_list


class PlannedRun(NamedTuple):
    """One run: its number, its values on the axes, and all that a worker needs.

    `folder` is the folder of the campaign file, `files` are model, record and reference file, as far as the run has
    them.
    """

    number: int
    levels: Mapping[str, Level]
    settings: RunSettings
    documents: RunDocuments
    reference: ReferenceConfig | None
    disturbance: tuple[DisturbanceConfig, ...]
    folder: Path
    files: tuple[RunFile, ...]


@dataclass(frozen=True)
class CampaignPlan:
    """A campaign file with its axes. `path` is the file, and `text` its content."""

    path: Path
    text: str
    config: CampaignConfig
    axes: tuple[Axis, ...]

    @property
    def folder(self) -> Path:
        """The folder to which the paths in the file are relative."""
        return self.path.parent.absolute()

    @property
    def count(self) -> int:
        """The number of runs."""
        return prod(len(axis.levels) for axis in self.axes)

    @property
    def metric(self) -> str:
        """The column that the report shows."""
        return self.config.report.metric or MAIN_METRICS[self.config.run.experiment]

    @cached_property
    def _files(self) -> CampaignFiles:
        return CampaignFiles()

    @cached_property
    def _reader(self) -> DocumentReader:
        return DocumentReader(self.folder, self._files)

    @cached_property
    def _base(self) -> dict[str, Any]:
        return self.config.run.model_dump(exclude_unset=True)

    def run(self, number: int) -> PlannedRun:
        """Return the run of this number, counted from 0. ConfigError if its settings are wrong."""
        changes = [axis.settings[place] for axis, place in zip(self.axes, self._places(number), strict=True)]
        return self._planned(number, self.run_levels(number), _changed(self._base, changes))

    def run_levels(self, number: int) -> dict[str, Level]:
        """Return the values of the run of this number on the axes."""
        return {axis.name: axis.levels[place] for axis, place in zip(self.axes, self._places(number), strict=True)}

    def _places(self, number: int) -> list[int]:
        """Return for each axis the index of the value that the run has."""
        places = []
        for axis in reversed(self.axes):
            number, place = divmod(number, len(axis.levels))
            places.append(place)
        return places[::-1]

    def _planned(self, number: int, levels: Mapping[str, Level], table: dict[str, Any]) -> PlannedRun:
        settings = validate(table, RunSettings, f"{self.path}: [run]")
        disturbance = _named(settings.disturbance, {NO_DISTURBANCE: (), **self.config.disturbances}, "disturbances")
        check_settings(table, settings, self.axes, [one.name for one in disturbance])
        if settings.seed is None:
            settings = settings.model_copy(update={"seed": self.config.seed})
        settings = _with_paths(settings, self.folder)
        name = settings.reference
        reference = None if name is None else self._reference(_named(name, self.config.references, "references"))
        return PlannedRun(
            number,
            levels,
            settings,
            self._reader.documents_of(settings),
            reference,
            disturbance,
            self.folder,
            self._run_files(settings.model, settings.record, reference.file if reference else None),
        )

    def _run_files(self, *paths: str | None) -> tuple[RunFile, ...]:
        return tuple(self._files.run_file(path) for path in paths if path is not None)

    def _reference(self, reference: ReferenceConfig) -> ReferenceConfig:
        if reference.file is None:
            return reference
        return reference.model_copy(update={"file": str(self.folder / reference.file)})

    @cached_property
    def fingerprint(self) -> str:
        """The digest of the settings in the campaign file, and of the content of all files that the runs read.

        It does not depend on the folder of the campaign, nor on [report], on which no run depends. A later change of a
        file does not change it.
        """
        digest = hashlib.sha256(self.config.model_dump_json(exclude={"report"}).encode())
        digest.update(repr([axis.levels for axis in self.axes]).encode())
        for run in self._runs_by_files():
            digest.update(f"{run.documents.excitation_digest} {run.documents.rig.displacement_from}".encode())
        for path in self._named_files():
            digest.update(self._files.run_file(str(path)).digest.encode())
        return digest.hexdigest()

    def _runs_by_files(self) -> Iterator[PlannedRun]:
        """Yield a run for each combination of rig, simulated wire, data sheet and profiles.

        A number on an axis neither names nor replaces a file. So the axes of numbers stay at their first values, and
        few runs stand for a campaign of many.
        """
        sizes = [len(axis.levels) for axis in self.axes]
        varied = [range(size if _may_name_a_file(axis) else 1) for axis, size in zip(self.axes, sizes, strict=True)]
        for places in product(*varied):
            number = 0
            for size, place in zip(sizes, places, strict=True):
                number = number * size + place
            yield self.run(number)

    def check_files(self) -> None:
        """Raise ConfigError if a model, a record or a reference file of any run cannot be read."""
        for path in self._named_files():
            with opened(path):
                pass

    def _named_files(self) -> Iterator[Path]:
        """Yield the models, the records and the reference files that the campaign names, each once, in a fixed order.

        They are taken from the axes instead of the runs: a campaign has many more runs than values.
        """
        references = self.config.references
        tables = [references[name].file for name in self._names("reference") if name in references]
        names = [*self._names("model"), *self._names("record"), *tables]
        yield from dict.fromkeys(self.folder / name for name in names if name is not None)

    def _names(self, key: str) -> list[str]:
        """Return the texts of a key of [run]: the values of its axis or, if it does not vary, the value in [run]."""
        varied = [settings[key] for axis in self.axes if key in axis.settings[0] for settings in axis.settings]
        return [value for value in varied or [self._base.get(key)] if isinstance(value, str)]

    def sample(self) -> Iterator[PlannedRun]:
        """Yield up to `SAMPLED` runs, evenly spread over the campaign. ConfigError if the settings of one are wrong."""
        yield from map(
            self.run, np.unique(np.linspace(0, self.count - 1, min(SAMPLED, self.count), dtype=int)).tolist()
        )


SAMPLED = 1000
"""At most this number of runs is checked before the campaign starts. The check of one run takes some 0.3 ms."""


def load_plan(name: str) -> CampaignPlan:
    """Return the plan of a campaign file, a path or the name of a shipped file. ConfigError if it is wrong."""
    path = config_file(name, CAMPAIGN)
    check_name(path.absolute())
    config = load_campaign(path)
    axes = axes_of(config.vary, config.seed, path.parent)
    check_seeds(config.run.model_dump(exclude_unset=True), axes)
    return CampaignPlan(path, path.read_text(encoding="utf-8-sig"), config, axes)


def _may_name_a_file(axis: Axis) -> bool:
    """Return True if values of the axis are texts or tables for rig or wire: these may name a file."""
    values = (item for change in axis.settings for item in change.items())
    return any(
        path.partition(".")[0] in ("rig", "sim", "wire") and not isinstance(one, int | float) for path, one in values
    )


def _changed(table: dict[str, Any], changes: list[Mapping[str, Any]]) -> dict[str, Any]:
    """Return the settings with the values of all axes at their paths. Tables on an axis and in [run] are merged."""
    result = table
    for path, value in (item for change in changes for item in change.items()):
        *outer, last = path.split(".")
        inner = {last: value}
        for key in reversed(outer):
            inner = {key: inner}
        result = merged(result, inner, "[[vary]]")
    return result


def _named(name: str, tables: Mapping[str, Any], kind: str) -> Any:
    if name not in tables:
        cure = suggestion_or_list(name, tables) if tables else f"write a table [{kind}.{name}]"
        raise ConfigError(f"[{kind}] has no table of this name", where="[run]", value=name, cure=cure)
    return tables[name]


def _with_paths(settings: RunSettings, folder: Path) -> RunSettings:
    """Return the settings with absolute paths of model and record, because a worker has another working folder."""
    paths = {key: str(folder / value) for key in ("model", "record") if (value := getattr(settings, key)) is not None}
    return settings.model_copy(update=paths)
