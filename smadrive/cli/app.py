"""The commands of `smadrive` by name, and the options before a command."""

from __future__ import annotations

import importlib
from typing import Annotated

import typer

COMMANDS = {
    "demo": "Identify and drive a simulated wire, and write a report.",
    "scan": "Find the devices on a line and the profiles that match them.",
    "probe": "Connect to a rig, check its devices, show live values.",
    "excite": "Run the identification experiment on a rig.",
    "identify": "Fit a hysteresis model to recorded data.",
    "simulate": "Simulate a model for the input in a file.",
    "invert": "Find the input with which a model follows the output in a file.",
    "run": "Track a displacement reference on a rig.",
    "tune": "Open the live tuning page of a rig.",
    "report": "Show a log as one page with plots, metrics, faults and provenance, or as CSV.",
    "replay": "Run model and controller again on a recorded run.",
    "paper": "Repeat the simulation of the published T-S fuzzy Duhem model.",
    "off": "Emergency stop: end the driver of a rig and confirm its heater off.",
}


def command_line(command: str) -> typer.Typer:
    """Return the command line with all commands. Only the module of `command` is imported."""
    app = typer.Typer(
        no_args_is_help=True,
        add_completion=False,
        pretty_exceptions_enable=False,
        help="Driver for shape-memory-alloy wires: moves a wire to the displacement that you set.",
    )
    app.callback()(_options)
    for name, summary in COMMANDS.items():
        if name == command:
            app.command(name)(importlib.import_module(f"smadrive.cli.{name}").main)
        else:
            app.command(name, help=summary)(_not_imported)
    return app


def _print_version(is_given: bool) -> None:
    if is_given:
        from importlib.metadata import version  # noqa: PLC0415 (this import alone takes 20 ms)

        print(f"smadrive {version('smadrive')}")
        raise typer.Exit


def _options(
    version: Annotated[
        bool, typer.Option("--version", is_eager=True, callback=_print_version, help="Print the version.")
    ] = False,
) -> None:
    """Declare the options that stand before a command."""


def _not_imported() -> None:
    """Stand for a command that this process does not run, so that the help lists it."""
