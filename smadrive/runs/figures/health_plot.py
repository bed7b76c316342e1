"""The plot of a health record: resistance at rest, moves of the loop and errors over the cycles of the wire."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes

from smadrive.display.colours import COOLING, ESTIMATED, FAINT, HEATING, LIMIT, MEASURED, SETPOINT
from smadrive.numerics.arrays import FloatArray
from smadrive.runs.plot_style import legend, panels
from smadrive.runs.report import Plot
from smadrive.wire.health.entry import Estimate, HealthEntry

CAPTION = (
    "Each point is a run, bars are standard errors. Dotted: the wire was identified. Circles: the adapted model at the "
    "end of a tuning session. At rest: resistance of the cold wire, leads and contacts included. Error of the model: "
    "its prediction of the displacement from the temperature alone."
)


def health_plot(entries: Sequence[HealthEntry]) -> Plot:
    """Return the plot over the cycles of the wire since the beginning of its record."""
    cycles = np.cumsum([entry.cycles for entry in entries])
    figure, (rest, places, stroke, errors) = panels([1.35] * 4)
    _draw(rest, cycles, [entry.rest_ohm for entry in entries], SETPOINT)
    rest.set_ylabel("at rest / Ω")
    first = next((entry for entry in entries if entry.is_identification), entries[0])
    for name, colour in (("heating", HEATING), ("cooling", COOLING)):
        start_c = getattr(first, f"{name}_c").value
        moved = [_minus(getattr(entry, f"{name}_c"), start_c) for entry in entries]
        _draw(places, cycles, moved, colour, f"{name} branch")
        _draw_adapted(places, cycles, [_adapted(entry, f"{name}_c") - start_c for entry in entries], colour)
    places.set_ylabel("moved by / K")
    _draw(stroke, cycles, [entry.stroke_mm for entry in entries], MEASURED)
    _draw_adapted(stroke, cycles, [_adapted(entry, "stroke_mm") for entry in entries], MEASURED)
    stroke.set_ylabel("stroke / mm")
    for name, title, colour in (("model_percent", "model", ESTIMATED), ("rms_percent", "tracking", MEASURED)):
        _draw(errors, cycles, [Estimate(getattr(entry, name)) for entry in entries], colour, title)
    errors.set_ylabel("RMS error / %")
    errors.set_ylim(bottom=0.0)
    for ax in (places, errors):
        legend(ax)
    for ax in (rest, places, stroke, errors):
        ax.ticklabel_format(useOffset=False, axis="y")
        for number in np.flatnonzero([entry.is_identification for entry in entries]):
            ax.axvline(cycles[number], color=LIMIT, ls=":", lw=1.0)
    errors.set_xlabel("cycles of the wire")
    return Plot("Health of the wire", figure, CAPTION)


def _draw(ax: Axes, cycles: FloatArray, values: Sequence[Estimate], colour: str, title: str = "") -> None:
    """Draw the known values over the cycles, with their errors."""
    is_known = np.array([value.is_known for value in values])
    if not is_known.any():
        return
    found, error = np.array(values, np.float64)[is_known].T
    ax.errorbar(
        cycles[is_known],
        found,
        np.nan_to_num(error),
        color=colour,
        marker=".",
        ms=5.0,
        lw=1.0,
        label=title,
        elinewidth=0.8,
        ecolor=FAINT,
        capsize=1.5,
    )


def _draw_adapted(ax: Axes, cycles: FloatArray, values: Sequence[float], colour: str) -> None:
    ax.plot(cycles, values, ls="", marker="o", mfc="none", mec=colour, ms=6.5)


def _adapted(entry: HealthEntry, name: str) -> float:
    return float("nan") if entry.adapted is None else float(getattr(entry.adapted, name))


def _minus(value: Estimate, start: float) -> Estimate:
    return Estimate(value.value - start, value.error)
