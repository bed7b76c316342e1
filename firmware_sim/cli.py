"""firmware-sim: a simulated device with a wire on it, on a serial port or a TCP port."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Callable, Iterator
from enum import StrEnum
from pathlib import Path
from typing import Annotated, TextIO

import typer

from firmware_sim.bench import SimulatedBench
from firmware_sim.config import load_sim
from firmware_sim.device import SimulatedDevice
from firmware_sim.doors import Door, Terminal
from firmware_sim.linespeed import SlowLine
from firmware_sim.ports import Port
from firmware_sim.serve import Server, stop_on_signal
from firmware_sim.tcpdoor import TcpDoor
from firmware_sim.timeline import load_script
from smadrive.device.profile import load_profile
from smadrive.errors import ConfigError, SmadriveError

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
    tcp: Annotated[
        str | None, typer.Option(help="Serve Modbus TCP there instead; PORT alone: this machine.", metavar="HOST:PORT")
    ] = None,
    rtu_tcp: Annotated[
        str | None, typer.Option(help="Serve RTU frames on TCP, as a gateway does.", metavar="HOST:PORT")
    ] = None,
    line_speed: Annotated[
        bool, typer.Option("--line-speed", help="Characters take the time of the baud rate.")
    ] = False,
    profile: Annotated[str, typer.Option(help="The register map: a shipped name or a path.")] = "sma-reference",
    time: Annotated[Time, typer.Option(help="real: the machine's; driven: told on standard input.")] = Time.REAL,
    faults: Annotated[
        Path | None, typer.Option(help="What goes wrong and when (docs/simulator.md).", metavar="FAULTS.toml")
    ] = None,
    seed: Annotated[int, typer.Option(help="Of the sensors' noise and of random faults.")] = 0,
    log: Annotated[Path | None, typer.Option(help="Write the event lines there instead of standard error.")] = None,
) -> None:
    """Serve a simulated device on a serial port, or a TCP port, and print its URL as the first line."""
    try:
        with _event_log(log) as events:
            bench = SimulatedBench(load_sim(sim), seed, _line_writer(events))
            device = bench.attach(load_profile(profile))
            if faults is not None:
                bench.follow_script(load_script(faults))
            _serve(bench, device, _door(device, pty, tcp, rtu_tcp, line_speed=line_speed), time)
    except SmadriveError as error:
        typer.echo(f"firmware-sim: {error}", err=True)
        raise typer.Exit(error.exit_code) from None


def _door(device: SimulatedDevice, pty: Path | None, tcp: str | None, rtu_tcp: str | None, *, line_speed: bool) -> Door:
    if sum(option is not None for option in (pty, tcp, rtu_tcp)) > 1:
        raise ConfigError("--pty, --tcp and --rtu-tcp exclude each other: start one simulator for each")
    line = device.profile.serial_settings()
    if line_speed and (line is None or tcp is not None):
        raise ConfigError(
            "--line-speed: Modbus TCP has no serial line; serve a device that has one with --pty or --rtu-tcp"
        )
    if tcp is not None:
        return TcpDoor(tcp, "tcp", lambda: device.line.new_port(numbered=True))

    def rtu_port() -> Port:
        port = device.line.new_port(numbered=False)
        return SlowLine(port, line) if line_speed and line is not None else port

    if rtu_tcp is not None:
        return TcpDoor(rtu_tcp, "rtu+tcp", rtu_port)
    if line is None:
        raise ConfigError(f"'{device.profile.profile.id}' has no serial line: serve it with --tcp HOST:PORT")
    return Terminal(pty, rtu_port())


def _serve(bench: SimulatedBench, device: SimulatedDevice, door: Door, time: Time) -> None:
    try:
        with stop_on_signal(), contextlib.suppress(KeyboardInterrupt):
            typer.echo(door.url)
            sys.stdout.flush()
            server = Server(bench, (door,))
            device.faults.ears.append(server.ear(door))
            if time is Time.REAL:
                server.run_real()
            else:
                server.run_driven()
    finally:
        bench.switch_off()
        door.close()


def _line_writer(events: TextIO) -> Callable[[str], None]:
    def log(line: str) -> None:
        events.write(line + "\n")
        events.flush()

    return log


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
