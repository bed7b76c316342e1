"""The page of a fitted hysteresis model: loop, residuals, metrics, rules or parameters."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from smadrive.hysteresis import TSFuzzyDuhem
from smadrive.identification.duhem import DuhemFit
from smadrive.identification.wire import AnyFit
from smadrive.runs.plots import COOLING, ESTIMATED, FAINT, HEATING, STYLE, legend, line
from smadrive.runs.report import Banner, Grid, Listing, PagePart, Plot, Tiles, write_report

Array = NDArray[np.float64]


def write_fit_report(path: Path, fit: AnyFit, caveats: Iterable[str], source: str, axes: tuple[str, str]) -> None:
    """Write the page. `axes` names input and output with their units; `caveats` are those of the fit and the record."""
    measured = fit.predicted - fit.residual
    parts: list[PagePart] = [
        _verdict(fit),
        *(Banner("warning", f"Warning: {caveat}.") for caveat in caveats),
        _metrics(fit),
        Plot("The loop", _loop(fit, measured, axes), "Grey: the record. Colours: the model on the same input."),
        Plot(
            "Residuals",
            _residuals(fit, axes[0]),
            "Model minus record, along the record and over the input. Structure here is an error of the model.",
        ),
        *_parameters(fit),
    ]
    write_report(path, f"Hysteresis identified from {Path(source).name}", f"{len(measured)} samples.", parts)


def _verdict(fit: AnyFit) -> Banner:
    if fit.certificate.holds:
        return Banner("good", "Certified: contracting, bounded, and no branch turns.")
    shortcomings = ", ".join(fit.certificate.shortcomings)
    return Banner("bad", f"Not certified, the model may not drive a feedforward: {shortcomings}.")


def _metrics(fit: AnyFit) -> Tiles:
    certificate = fit.certificate
    return Tiles(
        [
            (f"{fit.rms_percent:.3f} %", "RMS error, of the output span"),
            (f"{fit.max_percent:.3f} %", "largest error"),
            (f"{certificate.contraction_rate:.3g}", "contraction, per unit of input; above 0 an initial error decays"),
            (f"{100 * certificate.invertible_share:.1f} %", "of the loop has one input for each output; best is 100 %"),
        ]
    )


def _loop(fit: AnyFit, measured: Array, axes: tuple[str, str]) -> Figure:
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(9.0, 4.5), layout="constrained")
        ax = figure.subplots()
    ax.plot(fit.path, measured, ".", color=FAINT, ms=3, label="record")
    moves = np.diff(fit.path, prepend=fit.path[0])
    for name, chosen, color in (("heating", moves >= 0, HEATING), ("cooling", moves < 0, COOLING)):
        ax.plot(fit.path, np.where(chosen, fit.predicted, np.nan), color=color, label=f"model, {name}")
    ax.set(xlabel=axes[0], ylabel=axes[1])
    legend(ax)
    return figure


def _residuals(fit: AnyFit, input_name: str) -> Figure:
    percent = 100 * fit.residual / fit.output_span
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(9.0, 3.2), layout="constrained")
        along, over = figure.subplots(1, 2, sharey=True)
    line(along, np.arange(len(percent), dtype=np.float64), percent, color=ESTIMATED, lw=0.8)
    along.set(xlabel="sample", ylabel="error, % of span")
    over.plot(fit.path, percent, ".", color=ESTIMATED, ms=3)
    over.set(xlabel=input_name)
    return figure


def _parameters(fit: AnyFit) -> list[PagePart]:
    if isinstance(fit.model, TSFuzzyDuhem):
        return _rules(fit.model)
    return _duhem_parameters(fit) if isinstance(fit, DuhemFit) else []


def _rules(model: TSFuzzyDuhem) -> list[PagePart]:
    header = ("centre", "a rising", "b rising", "a falling", "b falling")
    laws = zip(model.sets.centres, *model.heating_law, *model.cooling_law, strict=True)
    table = [tuple(f"{number + 0.0:.5g}" for number in row) for row in laws]
    return [Grid(header, table, title="Rules"), Listing("The rules as sentences", model.rules_text())]


def _duhem_parameters(fit: DuhemFit) -> list[PagePart]:
    model, errors = fit.model, fit.standard_errors
    rows = []
    for name, mixture, spread in (
        ("heating", model.heating, errors.heating),
        ("cooling", model.cooling, errors.cooling),
    ):
        for number in range(len(mixture.means)):
            values = (mixture.means, mixture.sigmas, mixture.weights)
            within = (spread.means, spread.sigmas, spread.weights)
            cells = (_with_error(v[number], e[number]) for v, e in zip(values, within, strict=True))
            rows.append((f"{name} {number + 1}", *cells))
    map_rows = [("scale", _with_error(model.scale, errors.scale)), ("offset", _with_error(model.offset, errors.offset))]
    return [
        Grid(("Gaussian", "mean", "σ", "weight"), rows, title="Parameters, with standard errors"),
        Grid(("output", "value"), map_rows, title="Output = offset + scale · state"),
    ]


def _with_error(value: float, error: float) -> str:
    return f"{value:.5g} ± {error:.2g}"
