"""`smadrive identify`: fit a model to recorded data."""

from __future__ import annotations

from dataclasses import asdict
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from smadrive.cli.terminal.output import AsJson, Output
from smadrive.cli.views.fit_view import fit_result, print_fit
from smadrive.cli.views.resistance_view import resistance_result
from smadrive.files.atomic import check_output
from smadrive.files.kinds import MODEL, PAGE
from smadrive.identification.tsfuzzy.fit import FUZZY_SETS
from smadrive.identification.wire import COMPONENTS, DUHEM_COMPONENTS, SETS, FitSettings
from smadrive.runs.record_fit import INPUT, OUTPUT, fit_file


class Kind(StrEnum):
    """The kind of model to fit."""

    tsfuzzy = "tsfuzzy"
    duhem = "duhem"


def main(
    data: Annotated[Path, typer.Argument(help="CSV, or the log (.h5) of `smadrive excite`.")],
    model_file: Annotated[Path, typer.Option("--model-file", "-o", help="Model file (JSON) to write.")],
    kind: Annotated[Kind, typer.Option(help="T-S fuzzy Duhem model, or Duhem model.")] = Kind.tsfuzzy,
    sets: Annotated[
        int | None,
        typer.Option(
            min=SETS[0],
            max=SETS[1],
            help=f"Number of fuzzy sets (--kind tsfuzzy), two rules each; by default {FUZZY_SETS}.",
        ),
    ] = None,
    components: Annotated[
        int | None,
        typer.Option(
            min=COMPONENTS[0],
            max=COMPONENTS[1],
            help=f"Gaussians per branch of a Duhem model (--kind duhem); by default {DUHEM_COMPONENTS}.",
        ),
    ] = None,
    memory: Annotated[
        int | None,
        typer.Option(
            help="Sets of the last turning point (--kind tsfuzzy), 4 to 40, or 1 for no memory; by default held-out "
            "loops decide.",
        ),
    ] = None,
    input_column: Annotated[str, typer.Option("--input", help="Column of the input (CSV).")] = INPUT,
    output_column: Annotated[str, typer.Option("--output", help="Column of the output (CSV).")] = OUTPUT,
    plot: Annotated[Path | None, typer.Option(help="Page (HTML) to write, with loop, residuals and rules.")] = None,
    as_json: AsJson = False,
) -> None:
    """Fit a hysteresis model to DATA. For a log, also fit the heat balance and remove the lag of the thermocouple."""
    output = Output(as_json)
    settings = FitSettings.of(kind.value, sets, memory, components, "--")
    check_output(model_file, MODEL, data)
    if plot is not None:
        check_output(plot, PAGE, data)
    with output.progress(f"fitting {data.name}"):
        result = fit_file(data, (input_column, output_column), settings)
    fit, thermal = result.fit, result.thermal
    replaced = model_file.exists()
    result.wire(str(data)).save(model_file)
    if plot is not None:
        from smadrive.cli.views.reports.fit_report import write_fit_report  # noqa: PLC0415 (matplotlib takes 0.5 s)

        write_fit_report(plot, result, str(data))
    print_fit(output, result)
    output.say(f"model: {model_file}{' (replaced)' if replaced else ''}")
    output.result(
        {
            **fit_result(fit, kind.value, model_file),
            "caveats": result.caveats,
            **({} if plot is None else {"plot_file": str(plot)}),
            **({} if thermal is None else {"heat_balance": asdict(thermal.balance), "within": thermal.within}),
            "resistance": resistance_result(result),
        }
    )
