"""The report of the demo: the identified loop, the two tracking runs, their errors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from smadrive.cli.views.metrics_table import HEADER, table_row
from smadrive.display.colours import COOLING, ESTIMATED, FAINT, HEATING, MEASURED, RUN_COLOURS, SETPOINT
from smadrive.identification.wire import WireFit
from smadrive.runs.figures.log_plots import NOT_SCORED, draw_error
from smadrive.runs.log.reader import Log
from smadrive.runs.metrics.run import TrackingMetrics
from smadrive.runs.plot_style import legend, line, panels
from smadrive.runs.report import Grid, Notes, Plot, write_report


@dataclass(frozen=True)
class DemoRun:
    """One tracking run of the demo."""

    name: str
    log: Log
    metrics: TrackingMetrics


def write_demo_report(path: Path, wire: WireFit, excitation: Log, runs: Sequence[DemoRun]) -> None:
    """Write the page. `runs` are both tracking runs; the run with the inverse comes first."""
    write_report(
        path,
        "smadrive demo: tracking with a simulated SMA wire",
        "Errors are setpoint minus displacement, in percent of the stroke. Both runs use the displacement sensor to "
        "correct their estimate of the wire.",
        [
            Grid(("run", *HEADER[1:]), [table_row(run.name, run.metrics) for run in runs]),
            _loop_plot(wire, excitation),
            _tracking_plot(runs),
            _error_plot(runs),
            _temperature_plot(runs),
            Notes(_notes(wire, excitation)),
        ],
    )


def _notes(wire: WireFit, excitation: Log) -> list[str]:
    fit, balance = wire.hysteresis, wire.thermal.balance
    samples = excitation.column("time_s").size
    model = (
        f"Model: {len(getattr(fit.model, 'rules', ()))} rules, identified from {samples} samples of the excitation: "
        f"{fit.rms_percent:.2f} % RMS, {fit.max_percent:.2f} % max of the span."
    )
    heat = (
        f"Heat balance found: {1e3 * balance.heat_capacity_j_per_k:.1f} mJ/K, {1e3 * balance.loss_w_per_k:.2f} mW/K, "
        f"latent heat {balance.latent_heat_j:.2f} J, thermocouple lag {1e3 * balance.thermocouple_lag_s:.0f} ms."
    )
    devices = ", ".join(f"{name}: {identity}" for name, identity in excitation.json("devices").items())
    origin = f"smadrive {excitation.version}, {excitation.start_time}, {devices}."
    return [model, heat, origin]


def _loop_plot(wire: WireFit, excitation: Log) -> Plot:
    figure, (ax,) = panels((4.0,))
    model = wire.hysteresis.model
    temperature, displacement = wire.thermal.wire_temperature_c, excitation.column("displacement_mm")
    ax.plot(temperature, displacement, ".", ms=2, color=FAINT, label="measured (excitation)", rasterized=True)
    sweep = np.linspace(float(temperature.min()), float(temperature.max()), 400)
    heating, cooling = np.split(model.simulate(np.concatenate((sweep, sweep[::-1]))), 2)
    ax.plot(sweep, heating, color=HEATING, lw=1.5, label="identified model, heating")
    ax.plot(sweep[::-1], cooling, color=COOLING, lw=1.5, label="cooling")
    ax.set(xlabel="wire temperature / °C", ylabel="displacement / mm")
    legend(ax)
    return Plot(
        "The loop",
        figure,
        "Heating runs along the right branch, cooling along the left; the inner curves are the reversals.",
    )


def _tracking_plot(runs: Sequence[DemoRun]) -> Plot:
    figure, (ax,) = panels((3.6,))
    for run, colour in zip(runs, RUN_COLOURS, strict=False):
        log = run.log
        line(ax, log.column("time_s"), log.column_with_gaps("displacement_mm"), color=colour, label=run.name)
    first = runs[0].log
    line(
        ax,
        first.column("time_s"),
        first.column_with_gaps("setpoint_mm"),
        color=SETPOINT,
        ls="--",
        lw=1,
        label="setpoint",
    )
    ax.set(xlabel="time / s", ylabel="displacement / mm")
    legend(ax)
    return Plot(
        "Tracking",
        figure,
        "The same wire and the same temperature loop; only the map from displacement to temperature differs.",
    )


def _error_plot(runs: Sequence[DemoRun]) -> Plot:
    figure, axes = panels((1.9,) * len(runs))
    for ax, run, colour in zip(axes, runs, RUN_COLOURS, strict=False):
        draw_error(ax, run.log, colour)
        title = f"{run.name}: {run.metrics.rms_percent:.2f} % RMS, {run.metrics.max_percent:.2f} % max"
        ax.set_title(title, loc="left", fontsize=10)
    axes[-1].set_xlabel("time / s")
    return Plot("Error", figure, f"{NOT_SCORED} Each run has a scale of its own.")


def _temperature_plot(runs: Sequence[DemoRun]) -> Plot:
    figure, (upper, lower) = panels((2.4, 1.8))
    run = runs[0]
    log = run.log
    time_s = log.column("time_s")
    line(upper, time_s, log.column_with_gaps("temperature_c"), color=FAINT, lw=1.6, label="thermocouple")
    line(upper, time_s, log.column_with_gaps("estimated_c"), color=ESTIMATED, label="wire, estimated")
    line(upper, time_s, log.column_with_gaps("setpoint_c"), color=SETPOINT, ls="--", lw=0.8, label="setpoint")
    upper.set_ylabel("temperature / °C")
    legend(upper)
    line(lower, time_s, 1e3 * log.column_with_gaps("current_a"), color=MEASURED, lw=0.9)
    lower.set(xlabel="time / s", ylabel="heater current / mA")
    return Plot(
        f"Temperature and current of the run with the {run.name}",
        figure,
        "At every turning point the wire must cross the width of the loop before it moves again.",
    )
