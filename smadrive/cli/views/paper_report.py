"""The page with the repeated figures of the paper."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from smadrive.hysteresis import DuhemModel, HysteresisModel, TSFuzzyDuhem
from smadrive.runs.report import Grid, Listing, Notes, Plot, write_report

Array = NDArray[np.float64]
HEADER = ("22 rules", "major loop", "mixed loop", "unseen, median", "unseen, worst")


def write_paper_report(
    path: Path,
    duhem: DuhemModel,
    models: Mapping[str, TSFuzzyDuhem],
    loops: Mapping[str, Array],
    rows: Sequence[Sequence[str]],
    reading: Sequence[str],
) -> None:
    """Write the page: the table of errors, the figures 3 to 13, the rules. `loops` are the inputs major and mixed.

    `models` holds the derived model first and the best model last. `rows` are those of the table, `reading` the notes.
    """
    derived, *_, best = models.values()
    plots = [
        Plot("Figures 3, 6, 7", _curves(duhem, loops), "Hysteresis curves of the Duhem model: major loop, mixed loop."),
        Plot("Figures 4, 5", _inputs(loops), "The inputs. Only the order of their values matters, not their speed."),
        Plot(
            "Figures 8, 9", _memberships(derived, best), "Memberships of v, as in the paper and fitted, and of dv/dt."
        ),
        Plot("Figures 10, 11", _curves(best, loops), "The same curves from 22 rules with fitted centres."),
        Plot("Figures 12, 13", _errors(duhem, models, loops), "Errors; grey: the band that the paper reports."),
    ]
    write_report(
        path,
        "Modeling of dynamic hysteresis based on a T-S fuzzy Duhem model, repeated",
        "Errors are model minus Duhem model, in the unit of k = 40. The unseen errors are the largest errors on each "
        "of a hundred random loops that no fit used, in % of k.",
        [
            Grid(HEADER, rows),
            *plots,
            Notes(reading),
            Listing("The rules, fitted centres", best.rules_text()),
        ],
    )


def _curves(model: HysteresisModel, loops: Mapping[str, Array]) -> Figure:
    figure = Figure(figsize=(9, 4), layout="constrained")
    for ax, (name, v) in zip(figure.subplots(1, 2, sharey=True), loops.items(), strict=True):
        ax.plot(v, model.simulate(v), lw=1)
        ax.set(title=f"{name} loop", xlabel="v", ylabel="y")
        ax.grid(alpha=0.3)
    return figure


def _inputs(loops: Mapping[str, Array]) -> Figure:
    figure = Figure(figsize=(9, 3), layout="constrained")
    for ax, (name, v) in zip(figure.subplots(1, 2, sharey=True), loops.items(), strict=True):
        ax.plot(v, lw=1)
        ax.set(title=f"{name} loop", xlabel="sample", ylabel="v")
        ax.grid(alpha=0.3)
    return figure


def _memberships(*models: TSFuzzyDuhem) -> Figure:
    figure = Figure(figsize=(9, 6), layout="constrained")
    *upper, last = figure.subplots(len(models) + 1, 1)
    for ax, model in zip(upper, models, strict=True):
        v = np.linspace(*model.input_range, 1201)
        ax.plot(v, model.sets.weights(v), lw=1)
        ax.set(xlabel="v", ylabel="membership")
    rate = np.array([-1.0, 0.0, 0.0, 1.0])
    last.plot(rate, [1, 1, 0, 0], rate, [0, 0, 1, 1], lw=1)
    last.set(xlabel="dv/dt", ylabel="membership", xticks=[-1, 0, 1], xticklabels=["falls", "0", "rises"])
    return figure


def _errors(duhem: DuhemModel, models: Mapping[str, TSFuzzyDuhem], loops: Mapping[str, Array]) -> Figure:
    figure = Figure(figsize=(9, 7), layout="constrained")
    for ax, (name, v) in zip(figure.subplots(2, 1), loops.items(), strict=True):
        ax.axhspan(-1.2, 1.0, color="0.93")
        for label, model in models.items():
            ax.plot(model.simulate(v) - duhem.simulate(v), lw=1, label=label)
        ax.set(title=f"{name} loop", xlabel="sample", ylabel="error")
        ax.grid(alpha=0.3)
    figure.axes[0].legend(fontsize=8)
    return figure
