"""The axes of a campaign: which settings vary, with which values, and the names of these values in the table."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from glob import glob
from itertools import combinations
from math import prod
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from smadrive.campaigns.plan.config import AxisConfig, GridConfig, RunSettings
from smadrive.campaigns.plan.files import check_name
from smadrive.errors import ConfigError
from smadrive.files.config import validate
from smadrive.files.number_text import shortened
from smadrive.files.spelling import suggestion_or_list

MOST_RUNS = 1_000_000
"""The largest number of runs of a campaign. Even short runs of this number take days on a large cluster."""

MOST_WHOLE = 2**63 - 1
"""The largest whole number that a column of the table can hold."""

Level = int | float | str | bool
"""A value of an axis, as it stands in the table of results."""


class Axis(NamedTuple):
    """One axis of a campaign.

    name        column of the axis in the table of results
    levels      values in this column
    settings    for each level, the settings of [run] that it changes: value by path
    is_sample   True for random wires and repeats: their values are a random sample, so the report does not compare them
    """

    name: str
    levels: tuple[Level, ...]
    settings: tuple[Mapping[str, Any], ...]
    is_sample: bool = False


def axes_of(configs: tuple[AxisConfig, ...], seed: int, folder: Path) -> tuple[Axis, ...]:
    """Return the axes. `seed` is the seed of the campaign; patterns of file names are relative to `folder`.

    ConfigError for an axis without values, for lists of different lengths, for values that need labels, for a value
    that is given twice, for two axes of one name, for an axis of experiments, and for more than `MOST_RUNS`
    combinations.
    """
    axes = tuple(_axis(config, seed, folder, f"[[vary]] {n}") for n, config in enumerate(configs, 1))
    names = [axis.name for axis in axes]
    for name in names:
        if names.count(name) > 1:
            raise ConfigError(f"two axes are called '{name}'", where="[[vary]]", cure='write name = "…" at one of them')
    _check_paths(axes)
    count = prod(len(axis.levels) for axis in axes)
    if count > MOST_RUNS:
        sizes = " x ".join(f"{len(axis.levels)} ({axis.name})" for axis in axes)
        raise ConfigError(
            "the campaign has too many runs",
            where="[[vary]]",
            value=f"{sizes} = {count}",
            limit=MOST_RUNS,
            cure="give fewer values, or take random wires instead of a grid",
        )
    return axes


def _check_paths(axes: tuple[Axis, ...]) -> None:
    """Raise ConfigError if two lists set the same key, or a key and a table that contains it: one would be lost."""
    paths = sorted(path for axis in axes for path in axis.settings[0])
    for path, following in combinations(paths, 2):
        if following == path or following.startswith(f"{path}."):
            what, cure = f"'{path}' and '{following}' set the same value", "vary each setting once"
            raise ConfigError(what, where="[[vary]]", cure=cure)


def _axis(config: AxisConfig, seed: int, folder: Path, where: str) -> Axis:
    _check_keys(config.model_extra or {}, where)
    lists = dict(_lists(config.model_extra or {}, where))
    if "experiment" in lists:
        cure = "write it in [run], and a campaign file for each experiment"
        raise ConfigError(
            "the experiment cannot vary: its runs have other metrics", where=f"{where}: experiment", cure=cure
        )
    is_sample = config.random_wires is not None or config.repeats is not None
    counted: dict[str, list[Any]] = {}
    if config.random_wires is not None:
        _check_size(config.random_wires, where)
        counted["wire.seed"] = list(range(seed, seed + config.random_wires))
    if config.repeats is not None:
        _check_size(config.repeats, where)
        counted["seed"] = list(range(seed, seed + config.repeats))
    if config.records is not None:
        counted["record"] = _files(config.records, folder, where)
    if twice := lists.keys() & counted.keys():
        raise ConfigError("set twice on this axis", where=f"{where}: {min(twice)}", cure="remove one of the two")
    lists |= counted
    if not lists or not all(lists.values()):
        raise ConfigError("nothing varies on this axis", where=where, cure="give a setting of [run] a list of values")
    lengths = {path: len(values) for path, values in lists.items()}
    if len(set(lengths.values())) > 1:
        text = ", ".join(f"{path}: {length}" for path, length in lengths.items())
        cure = "give each list the same number of values, or put the lists into two [[vary]] tables to combine them"
        raise ConfigError("lists of different lengths", where=where, value=text, cure=cure)
    first, values = next(iter(lists.items()))
    settings = tuple(dict(zip(lists, combined, strict=True)) for combined in zip(*lists.values(), strict=True))
    return Axis(config.name or first, _levels(config, values, folder, where), settings, is_sample)


def _check_keys(table: Mapping[str, Any], where: str) -> None:
    """Raise ConfigError for a key that is neither a key of an axis nor a setting of [run]."""
    keys = AxisConfig.model_fields.keys() | RunSettings.model_fields.keys()
    if unknown := [key for key in table if key not in keys and "." not in key]:
        raise ConfigError("unknown key", where=where, value=unknown[0], cure=suggestion_or_list(unknown[0], keys))


def _check_size(number: int, where: str) -> None:
    if number > MOST_RUNS:
        raise ConfigError("too many values", where=where, value=number, limit=MOST_RUNS, cure="give fewer values")


def _lists(table: Mapping[str, Any], where: str, path: str = "") -> Iterator[tuple[str, list[Any]]]:
    """Yield (path, values) for each list or grid in a tree of tables.

    ConfigError for a value that is neither, and for a name with a dot, which separates the keys of a path.
    """
    for key, value in table.items():
        name = f"{path}.{key}" if path else key
        if "." in key:
            cure = f'let a table vary that contains it: labels = ["…"], {path or "rig"} = [{{"{key}" = {{…}}}}]'
            raise ConfigError("a name with a dot cannot be a key of an axis", where=where, value=key, cure=cure)
        if isinstance(value, Mapping) and "number" in value:
            yield name, _grid(validate(dict(value), GridConfig, f"{where}: {name}"), f"{where}: {name}")
        elif isinstance(value, Mapping):
            yield from _lists(value, where, name)
        elif isinstance(value, list):
            yield name, value
        else:
            cure = f"write a list, or move the key to [run]: {name} = [{value!r}]"
            raise ConfigError("not a list of values", where=f"{where}: {name}", value=value, cure=cure)


def _grid(grid: GridConfig, where: str) -> list[float]:
    """Return the values of a grid, each rounded to six digits."""
    _check_size(grid.number, where)
    space = np.geomspace if grid.spacing == "logarithmic" else np.linspace
    return [float(f"{value:.6g}") for value in space(grid.low, grid.high, grid.number)]


def _files(pattern: str, folder: Path, where: str) -> list[str]:
    # brackets in the path of the folder are no pattern; the pattern may be an absolute path, unlike that of Path.glob
    found = sorted(glob(pattern, root_dir=folder, recursive=True))  # noqa: PTH207
    if not found:
        raise ConfigError("no file has a name of this pattern", where=f"{where}: records", value=str(folder / pattern))
    paths = [(folder / path).absolute() for path in found]
    for path in paths:
        check_name(path)
    return list(map(str, paths))


def _levels(config: AxisConfig, values: list[Any], folder: Path, where: str) -> tuple[Level, ...]:
    """Return the texts or numbers that stand for the values in the table."""
    if config.labels is not None:
        if len(config.labels) != len(values):
            raise ConfigError(
                "as many labels as values are needed", where=where, value=len(config.labels), limit=len(values)
            )
        if len(set(config.labels)) < len(config.labels):
            labels = ", ".join(config.labels)
            raise ConfigError("a label is given twice", where=where, value=labels, cure="give each value its own label")
        return config.labels
    plain = [os.path.relpath(value, folder) for value in values] if config.records is not None else values
    if not all(isinstance(value, Level) for value in plain):
        cure = 'name the values: labels = ["…", "…"]'
        raise ConfigError("values that are lists or tables need labels", where=where, cure=cure)
    levels = _of_one_kind(plain, where)
    if len(set(levels)) < len(levels):
        cure = "write each value once, or a grid of fewer values"
        raise ConfigError("a value is given twice", where=where, value=shortened(plain), cure=cure)
    return levels


def _of_one_kind(values: list[Level], where: str) -> tuple[Level, ...]:
    """Return the values, as texts if one of them is a text.

    A column of the table has one type. ConfigError for numbers together with true or false, and for a whole number
    beyond 64 bits.
    """
    if any(isinstance(value, str) for value in values):
        return tuple(map(str, values))
    if len({isinstance(value, bool) for value in values}) > 1:
        cure = 'name the values: labels = ["…", "…"]'
        raise ConfigError("numbers and true or false are mixed", where=where, value=shortened(values), cure=cure)
    for value in values:
        if isinstance(value, int) and abs(value) > MOST_WHOLE:
            cure = "give a smaller number"
            raise ConfigError("too large", where=where, value=shortened(value), limit=MOST_WHOLE, cure=cure)
    return tuple(values)
