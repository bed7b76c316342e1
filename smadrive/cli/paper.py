"""`smadrive paper`: repeat the published simulation, and show its errors beside the published ones.

S.-Y. Lee, M. Park, J. Baek, "Modeling of Dynamic Hysteresis Based on Takagi-Sugeno Fuzzy Duhem Model", IJFIS 2013:
11 x 2 rules rebuild a Duhem model on the input range [-300, 300]. The output of this model is k = 40 times its state.
The paper reports errors from -1.2 to 1. It shows its input signals as figures, without a table. Here, the major loop is
one sweep of the range and back; the mixed loop adds shrinking reversals.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from itertools import pairwise
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from numpy.typing import NDArray

from smadrive.cli.terminal.output import AsJson, Output, make_folder
from smadrive.cli.views.reports.paper_report import HEADER, write_paper_report
from smadrive.errors import ModelError
from smadrive.hysteresis import DuhemModel, TriangularSets, TSFuzzyDuhem
from smadrive.identification import identify_tsfuzzy

Array = NDArray[np.float64]

SETS = 11
RANDOM_LOOPS = 100
SAMPLES_PER_STRETCH = 200
PAPER_ERROR = (-1.2, 1.0)


@dataclass(frozen=True)
class Errors:
    """The errors of a rebuilt model: its output minus that of the Duhem model.

    `major` is the smallest and the largest error on the major loop of the paper, `mixed` the same on its mixed loop.
    Both have the unit of the output, whose full range is k = 40. No fit used the `RANDOM_LOOPS` random loops. Each of
    them has a largest error; `unseen_percent` is the median and the maximum of these errors, in % of k.
    """

    name: str
    major: tuple[float, float]
    mixed: tuple[float, float]
    unseen_percent: tuple[float, float]


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


def rebuild(duhem: DuhemModel) -> dict[str, TSFuzzyDuhem]:
    """Return three models of 11 x 2 rules: one derived from the Duhem model, two identified from its output."""
    uniform = np.linspace(*duhem.input_range, SETS)
    path = np.concatenate([major_loop(), random_loop(np.random.default_rng(2013), turns=120)])
    y = duhem.simulate(path)
    return {
        "derived, uniform sets": TSFuzzyDuhem.from_duhem(duhem, TriangularSets(tuple(uniform))),
        "identified, uniform sets": identify_tsfuzzy(path, y, sets=uniform.tolist(), fit_centres=False).model,
        "identified, fitted sets": identify_tsfuzzy(path, y, sets=SETS).model,
    }


def judge(name: str, model: TSFuzzyDuhem, duhem: DuhemModel) -> Errors:
    """Return the errors of the rebuilt `model` on all loops."""

    def error(path: Array) -> Array:
        return model.simulate(path) - duhem.simulate(path)

    random = np.random.default_rng(7)
    worst = [float(np.max(np.abs(error(random_loop(random, turns=12))))) for _ in range(RANDOM_LOOPS)]
    unseen = 100.0 * np.array(worst) / duhem.scale
    major, mixed = error(major_loop()), error(mixed_loop())
    return Errors(
        name,
        (float(major.min()), float(major.max())),
        (float(mixed.min()), float(mixed.max())),
        (float(np.median(unseen)), float(np.max(unseen))),
    )


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


def major_loop() -> Array:
    """Return the input of the major loop: from -300 to 300 and back."""
    return stretches([-300.0, 300.0, -300.0])


def mixed_loop() -> Array:
    """Return the input of the mixed loop: the major loop, followed by shrinking reversals inside it."""
    return stretches([-300.0, 300.0, -300.0, 200.0, -150.0, 120.0, -90.0, 60.0, -300.0])


def random_loop(random: np.random.Generator, turns: int) -> Array:
    """Return an input that goes from -300 through `turns` random turning points between -300 and 300."""
    return stretches([-300.0, *random.uniform(-300.0, 300.0, size=turns).tolist()])


def stretches(turns: list[float]) -> Array:
    """Return the input through the turning points `turns`, with `SAMPLES_PER_STRETCH` samples from one to the next."""
    return np.concatenate([np.linspace(a, b, SAMPLES_PER_STRETCH) for a, b in pairwise(turns)])
