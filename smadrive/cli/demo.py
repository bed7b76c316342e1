"""`smadrive demo`: identify and drive a simulated wire over Modbus on a virtual serial port, and write a report."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import asdict, dataclass, replace
from itertools import count
from pathlib import Path
from typing import Annotated

import typer

from smadrive.cli.terminal.output import AsJson, Output, make_empty_folder
from smadrive.cli.views.announcement import announce_excitation
from smadrive.cli.views.fit_view import fit_result
from smadrive.cli.views.metrics_table import HEADER, table_row
from smadrive.cli.views.reports.demo_report import DemoRun, write_demo_report
from smadrive.cli.views.run_view import shown
from smadrive.clock import Clock
from smadrive.control.feedforward.displacement import DisplacementInverse, HysteresisInverse
from smadrive.control.feedforward.static_map import StaticMap
from smadrive.control.references.slow_sine import slow_sine
from smadrive.identification.wire import WireFit, identify_wire
from smadrive.rig.config import RigConfig, load_rig
from smadrive.rig.rig import Rig
from smadrive.runs.experiments import Watch, excite, plan_excitation, track
from smadrive.runs.log.reader import Log, read_log
from smadrive.runs.metrics.run import tracking_metrics
from smadrive.runs.run_metadata import excitation_record
from smadrive.runs.tracking_plan import plan_tracking
from smadrive.testing.simulator import ServedSimulator
from smadrive.wire.identified_wire import IdentifiedWire
from smadrive.wire.wire_model import travel_mm

FOLDER = "smadrive-demo"
SIM = "flexinol-lt-0.15mm"
RIG = "simulated"
CYCLES = 2.0
"""Number of cycles of the reference in each tracking run."""
REST_S = 20.0
"""Time before each tracking run, in which the wire cools to ambient temperature."""

WITH, WITHOUT = "inverse feedforward", "plain temperature map"


def main(
    folder: Annotated[
        Path | None,
        typer.Option(
            "--output-dir",
            "-o",
            help="Empty folder for logs, model and report. By default smadrive-demo or, if that exists, "
            "smadrive-demo-2 and so on.",
        ),
    ] = None,
    real_time: Annotated[
        bool, typer.Option("--real-time", help="Run in real time (some ten minutes) instead of virtual time.")
    ] = False,
    seed: Annotated[int, typer.Option(min=0, max=2**32 - 1, help="Seed of the simulated sensors' noise.")] = 0,
    as_json: AsJson = False,
) -> None:
    """Excite a simulated wire, identify it from the record, track with and without the inverse, write a report."""
    output = Output(as_json)
    folder = make_empty_folder(folder or _unused_folder())
    model_file, report = folder / "model.json", folder / "report.html"
    lasts = "some ten minutes" if real_time else "some 30 s"
    output.say(f"demo: excites a simulated wire, identifies it, tracks a reference twice; takes {lasts}")
    with ServedSimulator(SIM, real_time=real_time, seed=seed, log=folder / "firmware.log") as simulator:
        config = load_rig(RIG).at(simulator.url)
        output.say(f"firmware-sim serves the simulated wire at {simulator.url.partition('?')[0]}")
        with _connected(config, simulator.clock, output) as rig:
            session = _Session(rig, folder, seed, output)
            excitation = session.excite()
            wire = session.identify(excitation)
            replace(wire.wire, source=str(excitation.path)).save(model_file)
            inverses: dict[str, DisplacementInverse] = {
                WITH: HysteresisInverse(wire.hysteresis.model),
                WITHOUT: StaticMap(wire.thermal.wire_temperature_c, excitation.column("displacement_mm")),
            }
            runs = [session.track(name, inverse, wire.wire) for name, inverse in inverses.items()]
    with output.progress("writing the report"):
        write_demo_report(report, wire, excitation, runs)
    output.table(HEADER, [table_row(run.name, run.metrics) for run in runs])
    output.say(f"report: {report}   model: {model_file}   logs: {folder}/*.h5")
    output.result(
        {
            "inverse": asdict(runs[0].metrics),
            "plain_map": asdict(runs[1].metrics),
            "identify": fit_result(wire.hysteresis, "tsfuzzy", model_file),
            "excitation_log_file": str(excitation.path),
            "report_file": str(report),
        }
    )


@dataclass(frozen=True)
class _Session:
    """The experiments of the demo on its rig; their logs go to `folder`."""

    rig: Rig
    folder: Path
    seed: int
    output: Output

    def excite(self) -> Log:
        path, excitation = self.folder / "excitation.h5", plan_excitation(self.rig)
        announce_excitation(self.output, excitation, self.rig.clock)
        excite(path, self.rig, excitation, self._watch("exciting"), seed=str(self.seed))
        return read_log(path)

    def identify(self, log: Log) -> WireFit:
        with self.output.progress("identifying"):
            return identify_wire(excitation_record(log), self.rig.nominal_balance)

    def track(self, name: str, inverse: DisplacementInverse, wire: IdentifiedWire) -> DemoRun:
        self.rig.cool_down(REST_S)
        plan = plan_tracking(
            self.rig, slow_sine(travel_mm(wire.model), CYCLES), wire, smooth=False, smooth_option="smooth"
        )
        self.output.warn(plan.caveats)
        path = self.folder / f"{name.replace(' ', '-')}.h5"
        loop = track(path, self.rig, plan, self._watch(f"tracking, {name}"), inverse, seed=str(self.seed))
        log = read_log(path)
        return DemoRun(name, log, tracking_metrics(log, loop))

    def _watch(self, title: str) -> Watch:
        return shown(title, self.rig.config.limits.current_max_a, quiet=self.output.quiet)


@contextmanager
def _connected(config: RigConfig, clock: Clock, output: Output) -> Iterator[Rig]:
    """Yield the connected rig. The driver first waits until the line is silent; in lockstep time this takes 5 s."""
    with ExitStack() as stack:
        with output.progress("connecting: waiting until the line is silent"):
            rig = stack.enter_context(Rig(config, clock))
        yield rig


def _unused_folder() -> Path:
    """Return the first of smadrive-demo, smadrive-demo-2, smadrive-demo-3, ... that does not exist."""
    numbered = (Path(FOLDER if n == 1 else f"{FOLDER}-{n}") for n in count(1))
    return next(folder for folder in numbered if not folder.exists())
