"""`smadrive demo`: the whole product at work on a simulated wire, over real Modbus frames on a real serial port."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated

import typer
from rich.progress import Progress

from smadrive.cli.demo_report import write_demo_report
from smadrive.cli.identify import certificate, rules
from smadrive.cli.output import AsJson, Output, make_folder
from smadrive.cli.run import APPROACH_S, HEADER, table_row
from smadrive.control.feedforward import DisplacementInverse, HysteresisInverse, StaticMap
from smadrive.control.loop import Tick
from smadrive.control.reference import Reference, sine
from smadrive.identification.wire_fit import WireFit, identify_wire
from smadrive.loggedrun import excitation_record, travel_mm
from smadrive.rig import Rig
from smadrive.rigconfig import load_rig
from smadrive.runfigures import TrackingFigures, tracking_figures
from smadrive.runlog import TickRecorder, record_excitation, record_tracking
from smadrive.telemetry.log import Log, read_log
from smadrive.testing.simulator import ServedSimulator
from smadrive.wirefile import save_wire

SIM = "flexinol-lt-0.15mm"
RIG = "simulated"
PERIOD_S = 56.0
"""0.0178 Hz, the sine of the published tracking records."""
LOW, HIGH = 0.2, 0.8
"""The reference sweeps this part of the identified stroke."""
REST_S = 20.0
"""Between experiments the wire cools to the room."""

WITH, WITHOUT = "inverse feedforward", "plain temperature map"


@dataclass(frozen=True)
class Arm:
    """One tracking run of the demo."""

    name: str
    log: Log
    figures: TrackingFigures


def main(
    folder: Annotated[Path, typer.Option("--output-dir", "-o", help="Where logs, model and report go.")] = Path(
        "smadrive-demo"
    ),
    real_time: Annotated[
        bool, typer.Option("--real-time", help="Run at 1x (some ten minutes) instead of virtual time.")
    ] = False,
    seed: Annotated[int, typer.Option(help="Seed of the simulated sensors' noise.")] = 0,
    as_json: AsJson = False,
) -> None:
    """Excite a simulated wire, identify it from the record, track with and without the inverse, write a report."""
    output = Output(as_json)
    make_folder(folder)
    with ServedSimulator(SIM, real_time=real_time, seed=seed, log=folder / "firmware.log") as simulator:
        config = load_rig(RIG).at(simulator.url)
        output.say(f"firmware-sim serves the simulated wire at {simulator.url}")
        with Rig(config, simulator.clock) as bench, output.progress() as progress:
            excitation = _excite(bench, progress, folder / "excitation.h5", seed)
            wire = _identify(bench, progress, excitation)
            save_wire(
                folder / "model.json",
                wire.hysteresis.model,
                wire.thermal.balance,
                {"rms_percent": wire.hysteresis.rms_percent, "max_percent": wire.hysteresis.max_percent},
                source=str(excitation.path),
            )
            inverses: dict[str, DisplacementInverse] = {
                WITH: HysteresisInverse(wire.hysteresis.model),
                WITHOUT: StaticMap(wire.thermal.wire_temperature_c, excitation.column("displacement_mm")),
            }
            arms = [_track(bench, progress, folder, name, inverse, wire, seed) for name, inverse in inverses.items()]
    report = folder / "report.html"
    write_demo_report(report, wire, excitation, [(arm.name, arm.log, arm.figures) for arm in arms])
    output.table(HEADER, [table_row(arm.name, arm.figures) for arm in arms])
    output.say(f"report: {report}   model: {folder / 'model.json'}   logs: {folder}/*.h5")
    output.result(
        {
            "inverse": asdict(arms[0].figures),
            "plain_map": asdict(arms[1].figures),
            "identify": {
                "kind": "tsfuzzy",
                "rules": rules(wire.hysteresis),
                "rms_percent": wire.hysteresis.rms_percent,
                "max_percent": wire.hysteresis.max_percent,
                "model_file": str(folder / "model.json"),
                "certificate": certificate(wire.hysteresis),
            },
            "excitation_log_file": str(excitation.path),
            "report_file": str(report),
        }
    )


def _excite(bench: Rig, progress: Progress, path: Path, seed: int) -> Log:
    excitation = bench.excitation(bench.heater.exchange(0.0).temperature_c)
    with record_excitation(path, bench, excitation, seed=str(seed)) as recorder:
        record = _shown(recorder, progress, "exciting", excitation.duration_s)
        bench.excite(excitation, record)
    return read_log(path)


def _identify(bench: Rig, progress: Progress, log: Log) -> WireFit:
    task = progress.add_task("identifying", total=None)
    wire = identify_wire(excitation_record(log), bench.nominal_balance)
    progress.update(task, total=1, completed=1)
    return wire


def _track(
    bench: Rig, progress: Progress, folder: Path, name: str, inverse: DisplacementInverse, wire: WireFit, seed: int
) -> Arm:
    model, balance = wire.hysteresis.model, wire.thermal.balance
    bench.rest(REST_S)
    experiment = _reference(*travel_mm(model)), model, balance, inverse
    path = folder / f"{name.replace(' ', '-')}.h5"
    with record_tracking(path, bench, *experiment, seed=str(seed)) as recorder:
        record = _shown(recorder, progress, f"tracking, {name}", experiment[0].duration_s)
        loop = bench.track(*experiment, record)
    log = read_log(path)
    return Arm(name, log, tracking_figures(log, loop))


def _reference(cold_mm: float, hot_mm: float) -> Reference:
    low_mm, high_mm = (cold_mm + part * (hot_mm - cold_mm) for part in (LOW, HIGH))
    return sine(low_mm=low_mm, high_mm=high_mm, period_s=PERIOD_S, cycles=2.0).with_approach(cold_mm, APPROACH_S)


def _shown(recorder: TickRecorder, progress: Progress, title: str, duration_s: float) -> Callable[[Tick], None]:
    """Takes ticks to the log and to the progress bar."""
    task = progress.add_task(title, total=duration_s)

    def record(tick: Tick) -> None:
        recorder.tick(tick)
        progress.update(task, completed=tick.time_s)

    return record
