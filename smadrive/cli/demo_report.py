"""The demo's report: the identified loop, the two tracking runs, their errors."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from smadrive.identification.wire_fit import WireFit
from smadrive.loggedrun import TrackingFigures
from smadrive.telemetry.log import Log
from smadrive.telemetry.report import Plot, write_report

ArmView = tuple[str, Log, TrackingFigures]

COLOURS = ("tab:blue", "tab:orange")
REFERENCE_COLOUR = "black"


def write_demo_report(path: Path, wire: WireFit, excitation: Log, arms: Sequence[ArmView]) -> None:
    """Write the page; `arms` are (name, log, figures) of the tracking runs, the inverse feedforward first."""
    rows = [
        (name, f"{f.rms_percent:.2f} %", f"{f.max_percent:.2f} %", str(f.trips), str(f.missed_deadlines))
        for name, _, f in arms
    ]
    write_report(
        path,
        "smadrive demo: a simulated SMA wire moves where it is told",
        "Errors are reference minus displacement, in percent of the stroke, without displacement feedback: "
        "the sensor only judges.",
        ("run", "RMS error", "max error", "trips", "missed deadlines"),
        rows,
        [_loop_plot(wire, excitation), _tracking_plot(arms), _error_plot(arms), _temperature_plot(arms)],
        _notes(wire, excitation),
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
    figure, axes = _axes(1)
    (ax,) = axes
    model = wire.hysteresis.model
    temperature, displacement = wire.thermal.wire_temperature_c, excitation.column("displacement_mm")
    ax.plot(temperature, displacement, ".", ms=1.5, color="0.6", label="measured (excitation)")
    low, high = float(temperature.min()), float(temperature.max())
    sweep = np.concatenate((np.linspace(low, high, 400), np.linspace(high, low, 400)))
    ax.plot(sweep, model.simulate(sweep), color=COLOURS[0], lw=1.5, label="identified model, major loop")
    ax.set(xlabel="wire temperature / °C", ylabel="displacement / mm")
    ax.legend()
    return Plot(
        "The loop",
        figure,
        "Heating runs along the right branch, cooling along the left; the inner curves are the reversals.",
    )


def _tracking_plot(arms: Sequence[ArmView]) -> Plot:
    figure, axes = _axes(1)
    (ax,) = axes
    _, first, _ = arms[0]
    for (name, log, _), colour in zip(arms, COLOURS, strict=True):
        ax.plot(log.columns["time_s"], log.columns["displacement_mm"], color=colour, lw=1, label=name)
    ax.plot(
        first.columns["time_s"], first.columns["reference_mm"], "--", color=REFERENCE_COLOUR, lw=1, label="reference"
    )
    ax.set(xlabel="time / s", ylabel="displacement / mm")
    ax.legend()
    return Plot(
        "Tracking",
        figure,
        "The same wire and the same temperature loop; only the map from displacement to temperature differs.",
    )


def _error_plot(arms: Sequence[ArmView]) -> Plot:
    figure, axes = _axes(len(arms))
    for ax, (name, log, figures), colour in zip(axes, arms, COLOURS, strict=True):
        error = log.columns["reference_mm"] - log.columns["displacement_mm"]
        ax.plot(log.columns["time_s"], error, color=colour, lw=0.8)
        ax.axhline(0.0, color=REFERENCE_COLOUR, lw=0.5)
        ax.set(ylabel="error / mm", title=f"{name}: {figures.rms_percent:.2f} % RMS")
    axes[-1].set_xlabel("time / s")
    return Plot("Error", figure, "Mind the scales: each run has its own.")


def _temperature_plot(arms: Sequence[ArmView]) -> Plot:
    figure, axes = _axes(2)
    name, log, _ = arms[0]
    time = log.columns["time_s"]
    axes[0].plot(time, log.columns["temperature_c"], color="0.7", lw=0.8, label="thermocouple")
    axes[0].plot(time, log.columns["estimated_c"], color=COLOURS[0], lw=1, label="estimated wire")
    axes[0].plot(time, log.columns["wanted_c"], "--", color=REFERENCE_COLOUR, lw=0.8, label="wanted")
    axes[0].set(ylabel="temperature / °C", title=name)
    axes[0].legend()
    axes[1].plot(time, 1e3 * log.columns["current_a"], color=COLOURS[0], lw=0.8)
    axes[1].set(xlabel="time / s", ylabel="heater current / mA")
    return Plot(
        "What the driver did",
        figure,
        "At every turning point the wire must cross the width of the loop before it moves again.",
    )


def _axes(rows: int) -> tuple[Figure, list[Axes]]:
    figure = Figure(figsize=(9, 2.4 + 2.2 * rows), layout="constrained")
    axes = figure.subplots(rows, 1, sharex=True, squeeze=False)
    for ax in axes[:, 0]:
        ax.grid(alpha=0.3)
    return figure, list(axes[:, 0])
