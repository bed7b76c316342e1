"""The tables of a campaign as Parquet files: results and effort.

The table of results has a row for each run, sorted by its number, with the axes first. The same campaign gives the same
file, to the last bit. Times of day, durations and processes differ each time, so they are in the table of effort.

    pandas.read_parquet("results.parquet")                                         a table
    pandas.read_parquet("results.parquet").set_index([AXES]).to_xarray()           a grid
    pandas.read_parquet("results.parquet").attrs["units"]                          the units by column
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from math import nan
from pathlib import Path
from typing import TYPE_CHECKING, Any

from smadrive.campaigns.experiments.columns import COLUMNS, ResultColumn, outcome_row
from smadrive.campaigns.experiments.run import RunResult
from smadrive.campaigns.plan.plan import CampaignPlan
from smadrive.campaigns.versions import table_versions
from smadrive.files.atomic import replacing

if TYPE_CHECKING:
    from pandas import DataFrame, Series

RESULTS, EFFORT = "results.parquet", "effort.parquet"

EFFORT_UNITS = {
    "began": "UTC",
    "duration_s": "s",
    "cpu_s": "s",
    "identification_cpu_s": "s",
    "process": "host:pid",
    "trace": "1",
}


def results_table(plan: CampaignPlan, results: Mapping[int, RunResult]) -> DataFrame:
    """Return the table of results. Its attributes hold units, meanings and provenance.

    A column of the report that no run has is missing in each row.
    """
    from pandas import DataFrame  # noqa: PLC0415 (a command that fails early needs no pandas)

    numbers = sorted(results)
    levels = [plan.run_levels(number) for number in numbers]
    columns: dict[str, Any] = {"run": numbers}
    columns |= {axis.name: [one[axis.name] for one in levels] for axis in plan.axes}
    rows = [{**outcome_row("done"), **results[number].row} for number in numbers]
    reported = {plan.metric, *(plan.config.report.by or ())}
    present = [name for name in COLUMNS if name in reported or any(name in row for row in rows)]
    columns |= {name: _series(COLUMNS[name], [row.get(name) for row in rows]) for name in present}
    table = DataFrame(columns)
    table.attrs = {
        "title": plan.config.title,
        "units": {name: COLUMNS[name].unit for name in present},
        "meanings": {name: COLUMNS[name].what for name in present},
        "axes": [axis.name for axis in plan.axes],
        "provenance": _provenance(plan),
    }
    return table


def effort_table(results: Mapping[int, RunResult]) -> DataFrame:
    """Return the table of durations, times of day, processes, and traces of unexpected errors."""
    from pandas import DataFrame  # noqa: PLC0415 (a command that fails early needs no pandas)

    numbers = sorted(results)
    efforts = [results[number].effort for number in numbers]
    columns = {name: [getattr(effort, name) for effort in efforts] for name in EFFORT_UNITS}
    table = DataFrame({"run": numbers, **columns})
    table.attrs = {"units": EFFORT_UNITS}
    return table


def write_table(table: DataFrame, path: Path) -> str:
    """Write a table to a Parquet file, completely or not at all. Return the SHA-256 digest of the file."""
    with replacing(path) as partial:
        table.to_parquet(partial, engine="pyarrow", compression="zstd", index=False)
        return hashlib.sha256(partial.read_bytes()).hexdigest()


def _series(column: ResultColumn, values: Sequence[Any]) -> Series[Any]:
    """Return the values of a column with their type. A missing number is NaN, a missing bool NA, a missing text ""."""
    from pandas import Series  # noqa: PLC0415 (a command that fails early needs no pandas)

    if column.kind is str:
        return Series(["" if value is None else value for value in values], dtype="str")
    if column.kind is bool:
        return Series(values, dtype="boolean")
    return Series([nan if value is None else float(value) for value in values], dtype="float64")


def _provenance(plan: CampaignPlan) -> dict[str, Any]:
    return {
        "campaign": plan.text,
        "fingerprint": plan.fingerprint,
        "seed": plan.config.seed,
        "versions": table_versions(),
    }
