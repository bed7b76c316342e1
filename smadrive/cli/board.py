"""`smadrive board`: check an `sma-reference` board on the desk, and calibrate it."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from smadrive.cli.terminal.output import AsJson, Output
from smadrive.errors import ConfigError, DataError
from smadrive.rig.ports.board_calibration import CONSTANTS, HeldCurrent, calibrate_board_at
from smadrive.rig.ports.board_check import check_board_at, error_of
from smadrive.runs.log.reader import Log, read_log
from smadrive.runs.run_log import BOARD_CONSTANTS

Port = Annotated[str, typer.Argument(help="/dev/ttyUSB0 or rtu+tcp://host:port", metavar="PORT")]

HEADER = ("check", "result", "seen")
SETTLED = 0.5
"""This share of the log, from its beginning, is left out, because the current may still settle."""
STEADY = 0.02
"""Largest allowed range of `in_force_a` in the rest of the log, as a share of its maximum."""

RECORD = "record the log with `smadrive heat RIG --current 0.3 --for 60`"


class BoardAction(StrEnum):
    """What to do with the board."""

    CHECK = "check"
    CALIBRATE = "calibrate"


def main(
    action: Annotated[
        BoardAction, typer.Argument(help="check: conformance and safety. calibrate: gains of current and voltage.")
    ],
    port: Port,
    log: Annotated[
        Path | None, typer.Option(help="calibrate: the log of `smadrive heat` at a constant current.", metavar="LOG")
    ] = None,
    current_a: Annotated[
        float | None, typer.Option("--current", min=0.0, help="calibrate: what the ammeter showed, A.")
    ] = None,
    voltage_v: Annotated[
        float | None, typer.Option("--voltage", min=0.0, help="calibrate: what the voltmeter showed, V.")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Check the board on PORT, or calibrate it.

    check: send the frames of the board's specification, and do the safety checks that need no wire. Disconnect the
    wire, and connect the thermocouple. The check arms the board for short times, with at most 60 mA. The exit code is 3
    if a reply is wrong, and 4 if the board fails a safety check.

    calibrate: compute the gains of the current source, the measured current and the measured voltage. They come from
    the log of a constant current, and from the readings of an ammeter and a voltmeter at this current. The gains are
    saved on the board. The heater stays off.
    """
    output = Output(as_json)
    given = (log, current_a, voltage_v)
    if action is BoardAction.CHECK:
        if given != (None, None, None):
            where, cure = "--log, --current, --voltage", f"leave them out, or write smadrive board calibrate {port}"
            raise ConfigError("these options belong to calibrate", where=where, cure=cure)
        _check(output, port)
    elif log is None or current_a is None or voltage_v is None:
        cure = f"{RECORD}, and give what the multimeters show"
        raise ConfigError("calibrate needs --log, --current and --voltage", where="board calibrate", cure=cure)
    else:
        _calibrate(output, port, read_log(log), current_a, voltage_v)


def _check(output: Output, port: str) -> None:
    results = []
    with output.progress("checking the board") as progress:
        (task,) = progress.task_ids
        for result in check_board_at(port):
            results.append(result)
            progress.update(task, description=result.name)
    output.table(HEADER, [(one.name, one.verdict, one.detail) for one in results], notes=True)
    output.result({"port": port, "checks": [one._asdict() for one in results]})
    if (error := error_of(results, port)) is not None:
        raise error


def _calibrate(output: Output, port: str, log: Log, current_a: float, voltage_v: float) -> None:
    held, constants = _held_current(log, current_a, voltage_v), _constants(log)
    with output.progress("calibrating the board"):
        gains = calibrate_board_at(port, held, constants)
    output.table(("register", "value"), [(name, f"{gain:.4f}") for name, gain in gains.items()])
    output.say(f"{port}: calibrated, and saved; record a new log to check it")
    output.result({"port": port, **gains})


def _held_current(log: Log, current_a: float, voltage_v: float) -> HeldCurrent:
    """Return the means over the settled part of the log, with the readings of the multimeters.

    DataError if the current in this part is not constant.
    """
    set_a, shown_a, shown_v = (log.column(name) for name in ("in_force_a", "current_a", "voltage_v"))
    settled = slice(int(SETTLED * len(set_a)), -1)
    held = set_a[settled]
    if len(held) == 0 or held.max() - held.min() > STEADY * held.max():
        raise DataError(
            "the current of this log is not constant",
            where=log.path,
            cure=RECORD,
        )
    return HeldCurrent(
        float(held.mean()), float(shown_a[settled].mean()), current_a, float(shown_v[settled].mean()), voltage_v
    )


def _constants(log: Log) -> dict[str, float]:
    """Return serial number and calibration constants of the board during the log. DataError if the log has none."""
    if BOARD_CONSTANTS not in log.metadata:
        raise DataError(
            "this log has no calibration constants of a board, because another command or an earlier version wrote it",
            where=log.path,
            cure=RECORD,
        )
    return log.parsed(BOARD_CONSTANTS, lambda values: {name: float(values[name]) for name in CONSTANTS})
