"""`smadrive replay`: run model and controller again on the measurements of a log."""

from __future__ import annotations

from dataclasses import asdict, replace
from math import isfinite
from pathlib import Path
from typing import Annotated

import typer

from smadrive.cli.terminal.output import AsJson, Output
from smadrive.display.number_text import count_text
from smadrive.runs.columns import COLUMNS
from smadrive.runs.log.reader import Log, read_log
from smadrive.runs.replay import Replay, prediction_percent, replay
from smadrive.runs.run_metadata import nominal_balance
from smadrive.wire.identified_wire import IdentifiedWire, load_wire


def main(
    log_file: Annotated[Path, typer.Argument(metavar="LOG", help="Log (.h5) of `run`, `excite` or `heat`.")],
    model: Annotated[
        Path | None, typer.Option(help="Model file for the replay; the model in the log by default.")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Run model and controller on the measurements in LOG, and show where their outputs differ from the recorded ones.

    The measurements stay the recorded ones: the wire does not react to a different output.
    """
    output = Output(as_json)
    log = read_log(log_file)
    output.warn(log.caveats)
    wire = None if model is None else _wire(model, log)
    with output.progress(f"replaying {log_file.name}"):
        again = replay(log, wire)
        predictions = _predictions(log, wire)
    _print_differences(output, again, predictions)
    output.result(
        {
            "log_file": str(log_file),
            "model_file": None if model is None else str(model),
            "ticks": int(again.time_s.size),
            "exact": again.exact,
            "differences": {name: asdict(difference) for name, difference in again.differences.items()},
            "prediction_percent": predictions,
            "caveats": log.caveats,
        }
    )


def _wire(path: Path, log: Log) -> IdentifiedWire:
    wire = load_wire(path)
    return replace(wire, heat_balance=wire.heat_balance or nominal_balance(log))


def _predictions(log: Log, wire: IdentifiedWire | None) -> dict[str, float]:
    """Return the RMS error of the displacement predicted by the `recorded` and by the `replayed` model, in % of stroke.

    The result is empty when the run used no model.
    """
    if "wire" not in log.metadata:
        return {}
    recorded = prediction_percent(log)
    return {"recorded": recorded, "replayed": recorded if wire is None else prediction_percent(log, wire)}


def _print_differences(output: Output, again: Replay, predictions: dict[str, float]) -> None:
    ticks = again.time_s.size
    if again.exact:
        output.say(f"{count_text(ticks, 'tick')}: the replay is identical to the record")
    else:
        output.table(("signal", "max difference", "RMS difference", "first at"), _rows(again))
    if all(isfinite(value) for value in predictions.values()) and predictions:
        output.say(
            "displacement predicted without a sensor against the measured one, RMS in % of the stroke: "
            + ", ".join(f"{name} {value:.2f}" for name, value in predictions.items())
        )


def _rows(again: Replay) -> list[tuple[str, ...]]:
    rows: list[tuple[str, ...]] = []
    for name, difference in again.differences.items():
        unit = f" {COLUMNS[name].difference_unit}".removesuffix(" 1")
        if isfinite(difference.first_s):
            rows.append(
                (name, f"{difference.max:.3g}{unit}", f"{difference.rms:.3g}{unit}", f"{difference.first_s:.2f} s")
            )
        else:
            rows.append((name, "none", "none", "never"))
    return rows
