"""`smadrive simulate`: compute the output of a model for the input in a file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from smadrive.cli.terminal.output import AsJson, Output
from smadrive.display.number_text import count_text
from smadrive.errors import DataError
from smadrive.files.atomic import check_output
from smadrive.files.csv_table import read_table, replaced_caveats, write_table
from smadrive.files.kinds import TABLE
from smadrive.hysteresis import HysteresisModel, load_model
from smadrive.numerics.arrays import FloatArray


def main(
    model: Annotated[Path, typer.Argument(help="Model file (JSON), as written by `identify`.")],
    csv: Annotated[Path, typer.Argument(help="CSV with the input.")],
    output_file: Annotated[Path, typer.Option("--output-file", "-o", help="CSV to write.")],
    input_column: Annotated[str, typer.Option("--input", help="Column of the input.")] = "temperature_c",
    output_column: Annotated[str, typer.Option("--output", help="Column to write.")] = "displacement_mm",
    as_json: AsJson = False,
) -> None:
    """Simulate MODEL for the input in CSV, and write the model's output as a further column."""
    output = Output(as_json)
    check_output(output_file, TABLE, model, csv)
    table, loaded = read_table(csv), load_model(model)
    v = table.column(input_column)
    caveats = *replaced_caveats(table, output_column, "--output"), *_range_caveats(loaded, v, f"{csv}, {input_column}")
    y = loaded.simulate(v)
    write_table(output_file, table.cells, {output_column: y})
    output.warn(caveats)
    output.say(f"{output_file}: {count_text(len(y), 'sample')}, {output_column} from {y.min():.4g} to {y.max():.4g}")
    output.result({"samples": len(y), "output_file": str(output_file), "caveats": caveats})


def _range_caveats(model: HysteresisModel, v: FloatArray, where: str) -> tuple[str, ...]:
    """Return a caveat if the input leaves the range of `model`. DataError if no input is inside."""
    low, high = model.input_range
    outside = (v < low) | (v > high)
    if outside.all():
        raise DataError(
            "the model describes no value of the input",
            where=where,
            value=f"{v.min():g} to {v.max():g}",
            limit=f"{low:g} to {high:g}",
            cure="use the unit in which the model was identified, or choose another column with --input",
        )
    if not outside.any():
        return ()
    many = count_text(int(outside.sum()), "value")
    return (f"outside the model's range of {low:g} to {high:g} the output is constant: {many} of the input",)
