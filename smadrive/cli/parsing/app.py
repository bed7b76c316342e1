"""The commands of `smadrive` by name, and the options that stand before a command."""

from __future__ import annotations

import importlib
from collections.abc import Mapping, Sequence
from typing import Annotated

import typer

from smadrive.cli.parsing.usage import PlainCommand, PlainGroup, epilog_of
from smadrive.errors import ConfigError

COMMANDS = {
    "demo": "Identify and drive a simulated wire, and write a report.",
    "list": "List the shipped rigs, wires, device profiles, simulated wires and campaigns.",
    "scan": "Find the devices on a line and the profiles that match them.",
    "board": "Check a board on the desk, or calibrate its current and voltage.",
    "probe": "Connect to a rig, check its devices, show live values.",
    "watch": "Show the live values of a rig, without heat.",
    "calibrate": "Find offset and scale of a rig's sensor at known values.",
    "heat": "Hold a current or a temperature of the wire for a time.",
    "excite": "Run the identification experiment on a rig.",
    "identify": "Fit a hysteresis model to recorded data.",
    "simulate": "Simulate a model for the input in a file.",
    "invert": "Find the input with which a model follows the output in a file.",
    "run": "Track a displacement reference on a rig.",
    "tune": "Open the live tuning page of a rig.",
    "campaign": "Execute many simulated runs, or many fits, on all cores or on a Dask cluster.",
    "report": "Show a log as one page with plots, metrics, faults and provenance, or as CSV; or several side by side.",
    "replay": "Run model and controller again on a recorded run.",
    "paper": "Repeat the simulation of the published T-S fuzzy Duhem model.",
    "off": "Emergency stop: end the driver of a rig and confirm its heater off.",
}


COMPLETING = "_SMADRIVE_COMPLETE"
"""The environment variable with which a shell asks for completions."""

MODULES = {"list": "list_shipped"}
"""The modules of commands whose own name has another meaning in Python."""


def command_line(command: str) -> typer.Typer:
    """Return the command line with all commands. Only the module of `command` is imported."""
    app = typer.Typer(
        cls=PlainGroup,
        no_args_is_help=True,
        pretty_exceptions_enable=False,
        help="Driver for shape-memory-alloy wires: moves a wire to the displacement that you set.",
    )
    app.callback()(_options)
    for name, summary in COMMANDS.items():
        if name == command:
            module = importlib.import_module(f"smadrive.cli.{MODULES.get(name, name)}")
            app.command(name, cls=PlainCommand, epilog=epilog_of(name))(module.main)
        else:
            app.command(name, help=summary)(_not_imported)
    return app


def typed_command(arguments: Sequence[str], environment: Mapping[str, str]) -> str:
    """Return the first word after `smadrive`, in the command line or in the line that the shell completes.

    A leading `--` is no word: it only says that no option follows.
    """
    if COMPLETING in environment:
        typed = environment.get("_TYPER_COMPLETE_ARGS") or environment.get("COMP_WORDS", "")
        arguments = typed.split()[1:]
    return next(iter(arguments[1:] if arguments[:1] == ["--"] else arguments), "")


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
    """Stands for each command that the help lists but this process does not execute. Raise ConfigError.

    A command that did nothing and ended with exit code 0 would say that its work is done.
    """
    raise ConfigError(
        "the command is not the first word", where="command line", cure="write smadrive COMMAND, then its options"
    )
