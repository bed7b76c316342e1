"""`smadrive paper`: repeat the published simulation, and show its errors beside the published ones.

The paper (see identification/paper.py) reports errors of the output from -1.2 to 1, in the unit of its factor k = 40.
"""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from smadrive.cli.terminal.output import AsJson, Output, make_folder
from smadrive.cli.views.reports.paper_report import HEADER, write_paper_report
from smadrive.errors import ModelError
from smadrive.hysteresis import DuhemModel
from smadrive.identification.paper import PAPER_ERROR, Errors, judge, major_loop, mixed_loop, rebuild


def main(
    folder: Annotated[Path, typer.Option("--output-dir", "-o", help="Folder for the report.")] = Path("smadrive-paper"),
    as_json: AsJson = False,
) -> None:
    """Repeat the figures 3 to 13 of the paper, and compare the errors with the published ones."""
    output = Output(as_json)
    make_folder(folder)
    duhem = DuhemModel.table1()
    with output.progress("fitting 22 rules three ways"):
        models = rebuild(duhem)
    errors = [judge(name, model, duhem) for name, model in models.items()]
    report = folder / "report.html"
    write_paper_report(report, duhem, models, {"major": major_loop(), "mixed": mixed_loop()}, rows(errors), reading())
    output.table(HEADER, rows(errors))
    output.say(f"report: {report}")
    output.result({"paper_error": PAPER_ERROR, "errors": [asdict(one) for one in errors], "report_file": str(report)})


def rows(errors: list[Errors]) -> list[tuple[str, ...]]:
    """Return the rows of the table of errors. The first row holds the errors of the paper."""
    published = f"[{PAPER_ERROR[0]:g}, {PAPER_ERROR[1]:g}]"
    return [
        ("the paper", published, published, "-", "-"),
        *(
            (
                one.name,
                f"[{one.major[0]:.3f}, {one.major[1]:.3f}]",
                f"[{one.mixed[0]:.3f}, {one.mixed[1]:.3f}]",
                f"{one.unseen_percent[0]:.3f} %",
                f"{one.unseen_percent[1]:.3f} %",
            )
            for one in errors
        ),
    ]


def reading() -> list[str]:
    """Return two notes: why Table 1 is not usable as printed, and which values are used instead."""
    try:
        DuhemModel.gaussian(mu_heating=75, mu_cooling=70, sigma_heating=35, sigma_cooling=-45, input_range=(-300, 300))
    except ModelError as error:
        problem = str(error).removesuffix(".")
    printed = f"Table 1 as printed (k 40, μ₊ 75, μ₋ 70, σ₊ 35, σ₋ -45) is not a valid model: {problem}."
    used = (
        "Table 1 as it is used: k 40, μ₊ 35, μ₋ -45, σ₊ 75, σ₋ 70. The range ±300 is then 3.5 σ on either side, "
        "and the branches cross at -1165, far outside. The factor k is applied in y = k w, and not also in the slope."
    )
    return [printed, used]
