"""The page with the repeated figures of the paper."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from smadrive.display.colours import COOLING, ESTIMATED, FAINT, HEATING, MEASURED, SETPOINT, SHADE
from smadrive.hysteresis import DuhemModel, HysteresisModel, TSFuzzyDuhem
from smadrive.identification.paper import PAPER_ERROR
from smadrive.numerics.arrays import FloatArray
from smadrive.runs.plot_style import legend, panels, side_by_side
from smadrive.runs.report import Grid, Listing, Notes, Plot, write_report

HEADER = ("22 rules", "major loop", "mixed loop", "unseen, median", "unseen, worst")


def write_paper_report(
    path: Path,
    duhem: DuhemModel,
    models: Mapping[str, TSFuzzyDuhem],
    loops: Mapping[str, FloatArray],
    rows: Sequence[Sequence[str]],
    reading: Sequence[str],
) -> None:
    """Write the page: the table of errors, the figures 3 to 13, the rules. `loops` are the inputs of both loops.

    `models` holds the derived model first and the best model last. `rows` are the rows of the table of errors, and
    `reading` is its notes.
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


def _curves(model: HysteresisModel, loops: Mapping[str, FloatArray]) -> Figure:
    figure, axes = side_by_side(2, 3.8)
    for ax, (name, v) in zip(axes, loops.items(), strict=True):
        y = model.simulate(v)
        rises = np.append(np.diff(v) > 0, False)
        for where, colour, label in ((rises, HEATING, "v rises"), (~rises, COOLING, "v falls")):
            ax.plot(v, np.where(where, y, np.nan), color=colour, lw=1.2, label=label)
        ax.set(xlabel="v", ylabel="y")
        ax.set_title(f"{name} loop", loc="left", fontsize=10)
        legend(ax)
    return figure


def _inputs(loops: Mapping[str, FloatArray]) -> Figure:
    figure, axes = side_by_side(2, 2.6)
    for ax, (name, v) in zip(axes, loops.items(), strict=True):
        ax.plot(v, color=SETPOINT, lw=1.0)
        ax.set(xlabel="sample", ylabel="v")
        ax.set_title(f"{name} loop", loc="left", fontsize=10)
    return figure


def _memberships(*models: TSFuzzyDuhem) -> Figure:
    figure, (*upper, last) = panels((1.8,) * (len(models) + 1), share_x=False)
    for ax, model in zip(upper, models, strict=True):
        v = np.linspace(*model.input_range, 1201)
        ax.plot(v, model.sets.weights(v), color=MEASURED, lw=1.0)
        ax.set(xlabel="v", ylabel="membership")
    rate = np.array([-1.0, 0.0, 0.0, 1.0])
    last.plot(rate, [1, 1, 0, 0], color=COOLING, lw=1.2, label="falls")
    last.plot(rate, [0, 0, 1, 1], color=HEATING, lw=1.2, label="rises")
    last.set(xlabel="dv/dt", ylabel="membership", xticks=[-1, 0, 1], xticklabels=["falls", "0", "rises"])
    return figure


def _errors(duhem: DuhemModel, models: Mapping[str, TSFuzzyDuhem], loops: Mapping[str, FloatArray]) -> Figure:
    figure, axes = panels((2.6, 2.6), share_x=False)
    for ax, (name, v) in zip(axes, loops.items(), strict=True):
        ax.axhspan(*PAPER_ERROR, color=SHADE)
        for (label, model), colour in zip(models.items(), (FAINT, ESTIMATED, MEASURED), strict=True):
            ax.plot(model.simulate(v) - duhem.simulate(v), color=colour, lw=1.0, label=label)
        ax.set(xlabel="sample", ylabel="error")
        ax.set_title(f"{name} loop", loc="left", fontsize=10)
    legend(axes[0])
    return figure
