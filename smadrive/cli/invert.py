"""`smadrive invert`: find the input with which a model follows the output in a file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from numpy.typing import NDArray

from smadrive.cli.terminal.output import AsJson, Output
from smadrive.display.number_text import count_text
from smadrive.errors import DataError
from smadrive.files.atomic import check_output
from smadrive.files.csv_table import read_table, replaced_caveats, write_table
from smadrive.files.kinds import TABLE
from smadrive.hysteresis import HysteresisModel, InverseFeedforward, load_model

REACHABLE = "reachable"
"""The column that says for each sample if the model can follow, as 1 or 0."""


def main(
    model: Annotated[Path, typer.Argument(help="Model file (JSON), as written by `identify`.")],
    csv: Annotated[Path, typer.Argument(help="CSV with the setpoint of the output.")],
    output_file: Annotated[Path, typer.Option("--output-file", "-o", help="CSV to write.")],
    input_column: Annotated[str, typer.Option("--input", help="Column to write.")] = "temperature_c",
    output_column: Annotated[str, typer.Option("--output", help="Column of the setpoint.")] = "displacement_mm",
    start: Annotated[
        float | None, typer.Option(help="Input at the start; the low end of the model's range by default.")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Find the input with which MODEL follows the output in CSV.

    The column `reachable` is 0 where MODEL cannot follow. If MODEL can follow nowhere, the command ends with an error.
    """
    output = Output(as_json)
    check_output(output_file, TABLE, model, csv)
    table = read_table(csv)
    loaded = load_model(model)
    setpoint = table.column(output_column)
    v0 = loaded.input_range[0] if start is None else start
    result = InverseFeedforward(loaded).trajectory(setpoint, v0)
    if not result.reachable.any():
        raise _nothing_in_reach(csv, output_column, setpoint, loaded)
    caveats = replaced_caveats(table, input_column, "--input")
    if REACHABLE in table.cells:
        caveats = (*caveats, f"the computed column '{REACHABLE}' replaces that of {csv}: rename it there")
    write_table(output_file, table.cells, {input_column: result.v, REACHABLE: result.reachable.astype(np.float64)})
    unreachable = int((~result.reachable).sum())
    output.warn(caveats)
    output.say(f"{output_file}: {count_text(len(setpoint), 'sample')}, {unreachable} of them out of reach")
    output.result(
        {"samples": len(setpoint), "unreachable": unreachable, "output_file": str(output_file), "caveats": caveats}
    )


def _nothing_in_reach(csv: Path, column: str, setpoint: NDArray[np.float64], model: HysteresisModel) -> DataError:
    """Return the error for a column of setpoints if `model` reaches none of these setpoints."""
    ends = np.sort(model.simulate(np.array(model.input_range)))
    return DataError(
        "the model reaches no value",
        where=f"{csv}, column '{column}'",
        value=f"{setpoint.min():g} to {setpoint.max():g}",
        limit=f"{ends[0]:g} to {ends[1]:g}{_unit(column)}",
        cure="use the unit in which the model was identified, or choose another column with --output",
    )


def _unit(column: str) -> str:
    """Return the unit from the suffix of a column's name, such as " mm", with a space before it; "" if unknown."""
    unit = {"mm": "mm", "c": "°C"}.get(column.rpartition("_")[2])
    return f" {unit}" if unit else ""
