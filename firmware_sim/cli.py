"""firmware-sim: a simulated SMA heater board with a wire on it, on a serial port."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Iterator
from enum import StrEnum
from pathlib import Path
from typing import Annotated, TextIO

import typer

from firmware_sim.config import load_sim
from firmware_sim.device import SimulatedDevice
from firmware_sim.serve import Server, Terminal, stop_on_signal
from smadrive.device.profile import load_profile
from smadrive.errors import SmadriveError

main = typer.Typer(add_completion=False, pretty_exceptions_enable=False)


class Time(StrEnum):
    """Whose time the rig lives on."""

    REAL = "real"
    DRIVEN = "driven"


@main.command()
def serve(
    *,
    sim: Annotated[str, typer.Argument(help="A SIM.toml, or the name of a shipped one.", metavar="SIM.toml")],
    pty: Annotated[Path | None, typer.Option(help="Also reachable under this path (a symbolic link).")] = None,
    profile: Annotated[str, typer.Option(help="The register map: a shipped name or a path.")] = "sma-reference",
    time: Annotated[Time, typer.Option(help="real: the machine's; driven: told on standard input.")] = Time.REAL,
    seed: Annotated[int, typer.Option(help="Of the sensors' noise.")] = 0,
    log: Annotated[Path | None, typer.Option(help="Write the event lines there instead of standard error.")] = None,
) -> None:
    """Serve a simulated heater board on a serial port, and print the port's URL as the first line."""
    try:
        with _event_log(log) as events:
            _serve(sim=sim, profile=profile, pty=pty, time=time, seed=seed, events=events)
    except SmadriveError as error:
        typer.echo(f"firmware-sim: {error}", err=True)
        raise typer.Exit(error.exit_code) from None


def _serve(*, sim: str, profile: str, pty: Path | None, time: Time, seed: int, events: TextIO) -> None:
    def log(line: str) -> None:
        events.write(line + "\n")
        events.flush()

    device = SimulatedDevice.from_config(load_sim(sim), seed, load_profile(profile), log)
    terminal = Terminal(pty)
    try:
        with stop_on_signal(), contextlib.suppress(KeyboardInterrupt):
            typer.echo(f"serial://{terminal.path}")
            sys.stdout.flush()
            server = Server(device, terminal)
            if time is Time.REAL:
                server.run_real()
            else:
                server.run_driven()
    finally:
        device.switch_off()
        terminal.close()


@contextlib.contextmanager
def _event_log(path: Path | None) -> Iterator[TextIO]:
    if path is None:
        yield sys.stderr
        return
    try:
        file = path.open("a", encoding="utf-8")
    except OSError as error:
        typer.echo(f"firmware-sim: --log {path}: cannot be written ({error.strerror})", err=True)
        raise typer.Exit(2) from None
    with file:
        yield file


if __name__ == "__main__":
    main()
