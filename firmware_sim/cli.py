"""firmware-sim: a simulated device with a wire on it, on a serial port or a TCP port."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from enum import StrEnum
from pathlib import Path
from typing import Annotated, TextIO

import typer

from firmware_sim.bench import SimulatedBench
from firmware_sim.config import load_sim
from firmware_sim.devices.device import SimulatedDevice
from firmware_sim.devices.replay import Replay
from firmware_sim.fault_script import load_script
from firmware_sim.server.listen_address import Entrance, Kind, ListenAddress, open_door, open_entrances
from firmware_sim.server.server import Server, stop_on_signal
from smadrive.devices.profile.profile import load_profile
from smadrive.errors import ConfigError, SmadriveError

REFERENCE = "sma-reference"

main = typer.Typer(add_completion=False, pretty_exceptions_enable=False)


class Time(StrEnum):
    """Whose time the rig lives on."""

    REAL = "real"
    DRIVEN = "driven"


@main.command()
def serve(
    *,
    sim: Annotated[
        str | None, typer.Argument(help="A SIM.toml, or the name of a shipped one.", metavar="SIM.toml")
    ] = None,
    replay: Annotated[
        Path | None, typer.Option(help="Serve a recorded bus instead of a SIM.toml.", metavar="TRACE")
    ] = None,
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
    profile: Annotated[
        str | None, typer.Option(help=f"The register map: a shipped name or a path; without one, {REFERENCE}.")
    ] = None,
    time: Annotated[Time, typer.Option(help="real: the machine's; driven: told on standard input.")] = Time.REAL,
    faults: Annotated[
        Path | None, typer.Option(help="What goes wrong and when (docs/simulator.md).", metavar="FAULTS.toml")
    ] = None,
    seed: Annotated[int, typer.Option(min=0, max=2**32 - 1, help="Of the sensors' noise and of random faults.")] = 0,
    log: Annotated[Path | None, typer.Option(help="Write the event lines there instead of standard error.")] = None,
) -> None:
    """Serve simulated devices on serial or TCP ports, and print their URLs, one a line."""
    try:
        with _event_log(log) as events, ExitStack() as stack:
            tell = _line_writer(events)
            way_in = _way_in(pty, tcp, rtu_tcp)
            if replay is not None:
                if sim or profile or faults or line_speed:
                    raise ConfigError("--replay takes the place of SIM.toml, --profile, --faults and --line-speed")
                _serve_replay(Replay(replay, tell), way_in, stack, tell, time)
            else:
                bench = SimulatedBench(load_sim(_named(sim)), seed, tell)
                placed = _placed(bench, way_in, profile)
                if faults is not None:
                    bench.follow_script(load_script(faults))
                _serve_bench(bench, open_entrances(placed, stack, tell, line_speed=line_speed), time)
    except SmadriveError as error:
        typer.echo(f"firmware-sim: {error}", err=True)
        raise typer.Exit(error.exit_code) from None


def _way_in(pty: Path | None, tcp: str | None, rtu_tcp: str | None) -> ListenAddress | None:
    options: tuple[tuple[Kind, Path | str | None], ...] = (("pty", pty), ("tcp", tcp), ("rtu_tcp", rtu_tcp))
    given = [ListenAddress(kind, str(address)) for kind, address in options if address is not None]
    if len(given) > 1:
        raise ConfigError("--pty, --tcp and --rtu-tcp exclude each other: start one simulator for each")
    return given[0] if given else None


def _placed(
    bench: SimulatedBench, way_in: ListenAddress | None, profile: str | None
) -> list[tuple[SimulatedDevice, ListenAddress]]:
    """Every device of the sim file with its way in; without any there, the one that the options tell."""
    devices = bench.config.devices
    if not devices:
        return [(bench.attach(load_profile(profile or REFERENCE)), way_in or ListenAddress("pty"))]
    if way_in is not None or profile is not None:
        raise ConfigError("the sim file names its [[devices]]: leave --profile, --pty, --tcp and --rtu-tcp out")
    return [
        (bench.attach(load_profile(device.profile), device.unit_id, device.name), ListenAddress.of(device))
        for device in devices
    ]


def _named(sim: str | None) -> str:
    if sim is None:
        raise ConfigError("names no SIM.toml: give a path, the name of a shipped one, or --replay TRACE")
    return sim


def _serve_bench(bench: SimulatedBench, entrances: Sequence[Entrance], time: Time) -> None:
    server = Server(bench, [entrance.door for entrance in entrances])
    for entrance in entrances:
        for device in entrance.devices:
            device.faults.connect(server.ear(entrance.door), numbered=entrance.door.url.startswith("tcp:"))
    try:
        _run(server, [str(entrance) for entrance in entrances], time)
    finally:
        bench.switch_off()


def _serve_replay(
    replay: Replay, way_in: ListenAddress | None, stack: ExitStack, tell: Callable[[str], None], time: Time
) -> None:
    way_in = way_in or ListenAddress("tcp" if replay.numbered else "pty")
    door = open_door(way_in, lambda numbered: replay.new_port(numbered=numbered), None, tell, line_speed=False)
    stack.callback(door.close)
    _run(Server(replay, (door,)), [door.url], time)


def _run(server: Server, addresses: Sequence[str], time: Time) -> None:
    with stop_on_signal(), contextlib.suppress(KeyboardInterrupt):
        for address in addresses:
            typer.echo(address)
        sys.stdout.flush()
        if time is Time.REAL:
            server.run_real()
        else:
            server.run_driven()


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
