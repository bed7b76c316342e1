"""The command firmware-sim: simulated devices on one wire, served on serial ports or TCP ports."""

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
from firmware_sim.config import Implementation, SimConfig, load_sim
from firmware_sim.devices.device import SimulatedDevice
from firmware_sim.devices.replay import Replay
from firmware_sim.fault_script import load_script
from firmware_sim.server.listen_address import AddressKind, ListenAddress, open_endpoint
from firmware_sim.server.served_line import ServedLine, open_lines
from firmware_sim.server.server import Server, stop_on_signal
from smadrive.devices.profile.profile import load_profile
from smadrive.errors import ConfigError, SmadriveError
from smadrive.real_time import use_real_time_scheduling

REFERENCE = "sma-reference"

main = typer.Typer(add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None)


class Time(StrEnum):
    """The source of the simulation's time: the machine's clock, or standard input."""

    REAL = "real"
    LOCKSTEP = "lockstep"
    DRIVEN = "driven"  # the name of lockstep in version 0.1


@main.command()
def serve(
    *,
    sim: Annotated[
        str | None, typer.Argument(help="A SIM.toml, or the name of a shipped one.", metavar="SIM.toml")
    ] = None,
    replay: Annotated[
        Path | None, typer.Option(help="Serve a recorded bus instead of a SIM.toml.", metavar="TRACE")
    ] = None,
    pty: Annotated[
        Path | None, typer.Option(help="Serve on a pseudo-terminal, and make a link to it at PATH.", metavar="PATH")
    ] = None,
    tcp: Annotated[
        str | None,
        typer.Option(
            help="Serve Modbus TCP at this address. PORT alone serves this machine only.", metavar="HOST:PORT"
        ),
    ] = None,
    rtu_tcp: Annotated[
        str | None,
        typer.Option(help="Serve RTU frames on TCP at this address, as a gateway does.", metavar="HOST:PORT"),
    ] = None,
    line_speed: Annotated[
        bool, typer.Option("--line-speed", help="Delay replies as a serial line of the device's baud rate does.")
    ] = False,
    profile: Annotated[
        str | None,
        typer.Option(
            help="Register map: a shipped name or a path. Only for a SIM.toml without [[devices]]. "
            f"The default is {REFERENCE}.",
            metavar="PROFILE",
        ),
    ] = None,
    time: Annotated[
        Time,
        typer.Option(
            help="Source of the time: real (the machine's clock) or lockstep (standard input). "
            "driven is an older name of lockstep."
        ),
    ] = Time.REAL,
    board: Annotated[
        Implementation | None,
        typer.Option(
            help="Firmware of the board: python, native (the C core), or atmega328p (the program of an emulated "
            "microcontroller). Without this option the SIM.toml decides."
        ),
    ] = None,
    faults: Annotated[
        Path | None, typer.Option(help="A script of faults (docs/simulator.md).", metavar="FAULTS.toml")
    ] = None,
    seed: Annotated[
        int, typer.Option(min=0, max=2**32 - 1, help="Seed of the sensor noise and of random faults.", metavar="SEED")
    ] = 0,
    log: Annotated[
        Path | None, typer.Option(help="Write event lines to this file instead of standard error.", metavar="FILE")
    ] = None,
) -> None:
    """Serve simulated devices on serial or TCP ports, and print the URL of each port on a line."""
    try:
        with _event_log(log) as file, ExitStack() as stack:
            log_line = _line_writer(file)
            address = _listen_address(pty, tcp, rtu_tcp)
            if replay is not None:
                _check_alone(sim or profile or faults or line_speed or board or seed)
                _serve_replay(Replay(replay, log_line), address, stack, log_line, time)
            else:
                bench = SimulatedBench(_with_board(load_sim(_named(sim)), board), seed, log_line)
                devices = _attached(bench, address, profile)
                if faults is not None:
                    bench.follow_script(load_script(faults))
                _serve_bench(bench, open_lines(devices, stack, log_line, line_speed=line_speed), time)
    except SmadriveError as error:
        typer.echo(f"firmware-sim: {error}", err=True)
        raise typer.Exit(error.exit_code) from None


def _with_board(config: SimConfig, board: Implementation | None) -> SimConfig:
    if board is None:
        return config
    return config.model_copy(update={"board": config.board.model_copy(update={"implementation": board})})


def _check_alone(other: object) -> None:
    if other:
        raise ConfigError(
            "this option cannot be combined with SIM.toml, --profile, --board, --faults, --line-speed or --seed",
            where="--replay",
            cure="leave out the others",
        )


def _listen_address(pty: Path | None, tcp: str | None, rtu_tcp: str | None) -> ListenAddress | None:
    options: tuple[tuple[AddressKind, Path | str | None], ...] = (("pty", pty), ("tcp", tcp), ("rtu_tcp", rtu_tcp))
    given = [ListenAddress(kind, str(address)) for kind, address in options if address is not None]
    if len(given) > 1:
        where, cure = "--pty, --tcp and --rtu-tcp", "start one simulator for each address"
        raise ConfigError("these options cannot be combined", where=where, cure=cure)
    return given[0] if given else None


def _attached(
    bench: SimulatedBench, address: ListenAddress | None, profile: str | None
) -> list[tuple[SimulatedDevice, ListenAddress]]:
    """Return every device of the sim file with its listen address.

    A sim file without devices gives one device, with the profile and the address of the options.
    """
    devices = bench.config.devices
    if not devices:
        return [(bench.attach(load_profile(profile or REFERENCE)), address or ListenAddress("pty"))]
    if address is not None or profile is not None:
        raise ConfigError(
            "the sim file has [[devices]] of its own", cure="leave out --profile, --pty, --tcp and --rtu-tcp"
        )
    return [
        (bench.attach(load_profile(device.profile), device.unit_id, device.name), ListenAddress.of(device))
        for device in devices
    ]


def _named(sim: str | None) -> str:
    if sim is None:
        raise ConfigError("no SIM.toml is given", cure="give a path, the name of a shipped file, or --replay TRACE")
    return sim


def _serve_bench(bench: SimulatedBench, lines: Sequence[ServedLine], time: Time) -> None:
    server = Server(bench, [line.endpoint for line in lines])
    for line in lines:
        clients, numbered = server.faulty_connection(line.endpoint), line.endpoint.url.startswith("tcp:")
        for device in line.devices:
            device.faults.connect(clients, numbered=numbered)
    try:
        _run(server, [str(line) for line in lines], time)
    finally:
        bench.switch_off()


def _serve_replay(
    replay: Replay, address: ListenAddress | None, stack: ExitStack, log: Callable[[str], None], time: Time
) -> None:
    address = address or ListenAddress("tcp" if replay.numbered else "pty")
    endpoint = open_endpoint(address, lambda numbered: replay.new_port(numbered=numbered), None, log, line_speed=False)
    stack.callback(endpoint.close)
    _run(Server(replay, (endpoint,)), [endpoint.url], time)


def _run(server: Server, addresses: Sequence[str], time: Time) -> None:
    with stop_on_signal(), contextlib.suppress(KeyboardInterrupt):
        if time is Time.REAL:
            use_real_time_scheduling()  # a reply that is late on a busy machine would trip the driver
        _print_addresses(addresses)
        if time is Time.REAL:
            server.run_real()
        else:
            server.run_lockstep()


def _print_addresses(addresses: Sequence[str]) -> None:
    """Print the addresses to standard output. ConfigError when that fails: without them no client can connect."""
    try:
        for address in addresses:
            typer.echo(address)
    except OSError as error:
        sys.stdout = None  # otherwise the interpreter tries to write again when it ends
        raise ConfigError(
            "cannot be written", where="standard output", value=error.strerror, cure="redirect it to another place"
        ) from None


def _line_writer(file: TextIO) -> Callable[[str], None]:
    def log(line: str) -> None:
        try:
            file.write(line + "\n")
            file.flush()
        except OSError:  # the line is lost, and the devices go on
            if file is sys.stderr:
                sys.stderr = None  # otherwise the interpreter tries to write again when it ends

    return log


@contextlib.contextmanager
def _event_log(path: Path | None) -> Iterator[TextIO]:
    if path is None:
        yield sys.stderr
        return
    try:
        file = path.open("a", encoding="utf-8")
    except OSError as error:
        typer.echo(f"firmware-sim: --log {path}: cannot be written ({error.strerror}). Check the folder.", err=True)
        raise typer.Exit(2) from None
    try:
        yield file
    finally:
        with contextlib.suppress(OSError):
            file.close()


if __name__ == "__main__":
    main()
