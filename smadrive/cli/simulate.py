"""`smadrive simulate`: compute the output of a model for the input in a file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from smadrive.cli.terminal.output import AsJson, Output
from smadrive.display.card import count_text
from smadrive.files.atomic import check_output
from smadrive.files.csv_table import read_table, write_table
from smadrive.files.kinds import TABLE
from smadrive.hysteresis import load_model


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
    table = read_table(csv)
    y = load_model(model).simulate(table.column(input_column))
    write_table(output_file, table.cells, {output_column: y})
    output.say(f"{output_file}: {count_text(len(y), 'sample')}, {output_column} from {y.min():.4g} to {y.max():.4g}")
    output.result({"samples": len(y), "output_file": str(output_file)})
