"""The figures of a fitted wire: loop, residuals and resistance."""

from __future__ import annotations

import matplotlib as mpl
import numpy as np

from smadrive.display.colours import COOLING, ESTIMATED, HEATING, RECORD
from smadrive.hysteresis import HysteresisModel
from smadrive.identification.resistance_fit.fit import ResistanceFit
from smadrive.identification.wire import AnyFit
from smadrive.runs.figures.log_plots import draw_branches
from smadrive.runs.plot_style import STYLE, PlotFigure, legend, line, panels

DOTS = 700
"""A plot shows every n-th recorded sample: n = max(1, samples // DOTS)."""


def loop_figure(fit: AnyFit, axes: tuple[str, str]) -> PlotFigure:
    """Return the figure of the record and of the model's output for the same input.

    `axes` are the labels of input and output, with their units.
    """
    with mpl.rc_context(STYLE):
        figure = PlotFigure(figsize=(9.0, 4.5), layout="constrained")
        ax = figure.subplots()
    every = max(1, fit.path.size // DOTS)
    ax.plot(fit.path[::every], (fit.predicted - fit.residual)[::every], ".", color=RECORD, ms=6, label="record")
    moves = np.diff(fit.path, prepend=fit.path[0])
    for name, chosen, color in (("heating", moves >= 0, HEATING), ("cooling", moves < 0, COOLING)):
        ax.plot(fit.path, np.where(chosen, fit.predicted, np.nan), color=color, lw=1.0, label=f"model, {name}")
    ax.set(xlabel=axes[0], ylabel=axes[1])
    legend(ax)
    return figure


def model_figure(model: HysteresisModel) -> PlotFigure:
    """Return the figure of the major loop of a wire's model."""
    figure, (ax,) = panels((4.0,))
    draw_branches(ax, model)
    ax.set(xlabel="wire temperature / °C", ylabel="displacement / mm")
    legend(ax)
    return figure


def residual_figure(fit: AnyFit, input_name: str) -> PlotFigure:
    """Return the figure of model minus record, in % of the output span, over the sample number and over the input."""
    percent = 100 * fit.residual / fit.output_span
    with mpl.rc_context(STYLE):
        figure = PlotFigure(figsize=(9.0, 3.2), layout="constrained")
        along, over = figure.subplots(1, 2, sharey=True)
    line(along, np.arange(len(percent), dtype=np.float64), percent, color=ESTIMATED, lw=0.8)
    along.set(xlabel="sample", ylabel="error / % of span")
    over.plot(fit.path, percent, ".", color=ESTIMATED, ms=3)
    over.set(xlabel=input_name)
    return figure


def resistance_figure(fit: ResistanceFit) -> PlotFigure:
    """Return the figure of measured and fitted resistance over the phase, and of the residual over the temperature."""
    every = max(1, fit.ohm.size // DOTS)
    phase, ohm = fit.phase[::every], fit.ohm[::every]
    places = zip(fit.temperature_c[::every].tolist(), phase.tolist(), strict=True)
    fitted = np.array([fit.resistance.ohm(*place) for place in places])
    with mpl.rc_context(STYLE):
        figure = PlotFigure(figsize=(9.0, 3.2), layout="constrained")
        over, residual = figure.subplots(1, 2)
    over.plot(phase, ohm, ".", color=RECORD, ms=4, label="record")
    over.plot(phase, fitted, ".", color=ESTIMATED, ms=3, label="fit")
    over.set(xlabel="displacement / stroke", ylabel="resistance / Ω")
    legend(over)
    residual.plot(fit.temperature_c[::every], 1e3 * (ohm - fitted), ".", color=ESTIMATED, ms=3)
    residual.set(xlabel="wire temperature / °C", ylabel="residual / mΩ")
    return figure
