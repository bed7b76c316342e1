"""A recorded run in a script or a notebook: metrics, columns, plots, xarray."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from functools import cached_property
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from smadrive.display.ascii_text import ascii_text
from smadrive.display.card import card
from smadrive.display.colours import MEASURED
from smadrive.display.line_plot import INK, Curve, line_plot
from smadrive.display.number_text import quantity
from smadrive.errors import ConfigError
from smadrive.files.extras import install_cure
from smadrive.files.spelling import suggestion_or_list
from smadrive.runs.columns import COLUMNS
from smadrive.runs.cycling.cycles import CycleMetrics, cycles_of
from smadrive.runs.log.reader import Log
from smadrive.runs.log.reader import read_log as read_log_file
from smadrive.runs.metrics.caveats import run_caveats
from smadrive.runs.metrics.run import RunMetrics, run_metrics
from smadrive.runs.metrics.tracking_error import has_setpoint
from smadrive.scripting.arguments import path_text
from smadrive.scripting.loop.messages import DrivenRun

if TYPE_CHECKING:
    import xarray

    from smadrive.runs.plot_style import PlotFigure

FIGURES = {
    "tracking": "Tracking",
    "heat": "Heat",
    "loop": "Temperature and displacement",
    "timing": "Loop timing",
}
"""The figures of a run, and their titles in a report."""


class Run:
    """A run that was recorded in `log_file`.

        run = rig.track(smadrive.sine(low_mm=2, high_mm=9, period_s=56), wire)
        run.rms_percent, run.max_percent, run.trips
        run["displacement_mm"]

    `run[name]` is a column as a float64 array, with NaN where nothing was measured; `columns` lists the names. Tracking
    errors are in percent of the stroke. They leave out the approach, in which the wire moves to the beginning of the
    reference, and are NaN for a run without a setpoint. `log` holds events and metadata. `controller` is the user's
    controller at the end of the run; None for another run, and if it cannot be transferred.
    """

    def __init__(self, log: Log, driven: DrivenRun | None = None, warnings: Iterable[str] = ()) -> None:
        self._warnings = (*warnings, *(() if driven is None else driven.caveats))
        self.log = log
        self.controller = None if driven is None else driven.controller
        self._driven = driven

    @property
    def log_file(self) -> Path:
        """Path of the log of the run."""
        return self.log.path

    @property
    def kind(self) -> str:
        """`excitation`, `manual step`, `tracking`, `own controller`, `servo`, `observation` or `tuning`."""
        return self.log.kind.value

    @property
    def columns(self) -> tuple[str, ...]:
        """The names of the columns."""
        return tuple(name for name in COLUMNS if name in self.log.columns)

    def keys(self) -> tuple[str, ...]:
        """Return the names of the columns: a run can be read as a mapping."""
        return self.columns

    def __iter__(self) -> Iterator[str]:
        return iter(self.columns)

    def __contains__(self, name: object) -> bool:
        return name in self.log.columns

    def __getitem__(self, name: str) -> NDArray[np.float64]:
        return self.log.column_with_gaps(name)

    @cached_property
    def metrics(self) -> RunMetrics:
        """The metrics of the run, computed from its log."""
        return run_metrics(self.log)

    @cached_property
    def cycles(self) -> list[CycleMetrics]:
        """The metrics of each complete cycle of a repeated reference; empty for another run."""
        return cycles_of(self.log)

    @property
    def rms_percent(self) -> float:
        """RMS of setpoint - displacement, in % of the stroke."""
        return self.metrics.rms_percent

    @property
    def max_percent(self) -> float:
        """Largest magnitude of setpoint - displacement, in % of the stroke."""
        return self.metrics.max_percent

    @property
    def ticks(self) -> int:
        """Number of recorded ticks."""
        return self.metrics.ticks

    @property
    def missed_deadlines(self) -> int:
        """Number of ticks that began too late, or were left out."""
        return self.metrics.missed_deadlines if self._driven is None else self._driven.missed_deadlines

    @property
    def trips(self) -> int:
        """1 if a trip has ended the run, otherwise 0."""
        return int(self.log.is_tripped)

    @property
    def caveats(self) -> tuple[str, ...]:
        """Reasons to distrust the metrics, one sentence each."""
        return (*run_caveats(self.log), *self._warnings)

    def plot(self, figure: str | None = None) -> PlotFigure:
        """Return the matplotlib figure 'tracking', 'loop', 'heat' or 'timing'; by default the first that exists.

        ConfigError when the run has no such figure.
        """
        from smadrive.runs.figures.log_plots import log_plots  # noqa: PLC0415 (matplotlib takes 0.5 s)
        from smadrive.runs.plot_style import PlotFigure  # noqa: PLC0415

        plots = {plot.title: plot.figure for plot in log_plots(self.log)}
        names = [name for name, title in FIGURES.items() if title in plots]
        default = "tracking" if "tracking" in names else "loop" if "loop" in names else "heat"
        name = default if figure is None else figure
        if name not in names:
            raise ConfigError(
                "the run has no such figure", where="plot", value=name, cure=suggestion_or_list(name, names)
            )
        found = plots[FIGURES[name]]
        assert isinstance(found, PlotFigure)
        return found

    def to_xarray(self) -> xarray.Dataset:
        """Return the columns along `time_s`, with units and labels. ConfigError when xarray is not installed."""
        try:
            import xarray  # noqa: PLC0415 (not a dependency)
        except ImportError:
            raise ConfigError("xarray is not installed", where="to_xarray", cure=install_cure("xarray")) from None
        data = {
            name: ("time_s", self[name], {"units": COLUMNS[name].unit, "long_name": COLUMNS[name].label})
            for name in self.columns
        }
        time = data.pop("time_s")
        return xarray.Dataset(data, {"time_s": time}, {"log_file": str(self.log_file), "kind": self.kind})

    def facts(self) -> list[tuple[str, str]]:
        """Return the main facts of the run as pairs of texts: name, value with its unit."""
        metrics = self.metrics
        facts = [("length", quantity(metrics.duration_s, 1, "s")), ("ticks", str(self.ticks))]
        if isfinite(metrics.rms_percent):
            facts += [
                ("RMS error", f"{metrics.rms_percent:.2f} % of the stroke"),
                ("largest error", f"{metrics.max_percent:.2f} %"),
            ]
        facts += [
            ("hottest", quantity(metrics.temperature_max_c, 1, "°C")),
            ("largest current", quantity(metrics.current_max_a, 3, "A")),
            ("energy", quantity(metrics.energy_j, 0, "J")),
            ("trips", str(self.trips)),
            ("missed deadlines", str(self.missed_deadlines)),
        ]
        return [*facts, ("ended by", self.log.ended_by)] if self.log.ended_by else facts

    def __repr__(self) -> str:
        facts = (f"{name} {value}" for name, value in self.facts())
        warnings = (f"warning: {caveat}" for caveat in self.caveats)
        return ascii_text(f"Run({', '.join((self.kind, str(self.log_file), *facts, *warnings))})")

    def _repr_html_(self) -> str:
        title = f"{self.kind[0].upper()}{self.kind[1:]}, {self.log_file.name}"
        return card(title, self.facts(), self._small_plot(), self.caveats)

    def _small_plot(self) -> str:
        """Return a plot of displacement and setpoint over time; of the temperature if no displacement was measured."""
        time_s = self["time_s"].tolist()
        name = "displacement_mm" if np.isfinite(self["displacement_mm"]).any() else "temperature_c"
        curves = [Curve(time_s, self[name].tolist(), "measured", MEASURED)]
        if has_setpoint(self.log) and name == "displacement_mm":
            curves.append(Curve(time_s, self["setpoint_mm"].tolist(), "setpoint", INK, is_dashed=True))
        return line_plot(curves, COLUMNS["time_s"].axis_label, COLUMNS[name].axis_label)


def read_log(path: str | os.PathLike[str]) -> Run:
    """Return the run that was recorded in a log (.h5). DataError when the file is missing, damaged or not a log.

    run = smadrive.read_log("run.h5")
    """
    return Run(read_log_file(Path(path_text(path, "path", "the path of a log"))))
