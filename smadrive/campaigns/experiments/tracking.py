"""The tracking of a run: the reference on the simulated wire, and the metrics of the true displacement."""

from __future__ import annotations

from contextlib import nullcontext
from pathlib import Path

import numpy as np

from smadrive.campaigns.experiments.columns import Row, outcome_row
from smadrive.campaigns.experiments.controllers import RunController, controller_of
from smadrive.campaigns.experiments.identification import WireKnowledge
from smadrive.campaigns.experiments.references import PlannedReference, planned_reference
from smadrive.campaigns.experiments.simulated_rig import TRACKING, SimulatedRig, simulated_wire, tracked_wire, wire_row
from smadrive.campaigns.plan.plan import PlannedRun
from smadrive.control.controllers.tracking import TrackingController
from smadrive.control.loop import LoopMetrics, Tick
from smadrive.control.references.reference import Reference
from smadrive.errors import TripError
from smadrive.rig.rig import Rig
from smadrive.rig.supervision import wire_checks
from smadrive.runs.metrics.series import energy_j, of_finite, rms_and_max
from smadrive.runs.run_log import TickRecorder, record_tracking
from smadrive.safety.temperature_by_resistance import always
from smadrive.wire.wire_model import WireModel


class TickSeries:
    """The ticks of a tracking run that its metrics need, with the true state of the wire at each tick."""

    def __init__(self, simulated: SimulatedRig) -> None:
        self._plant = simulated.simulated_bench.plant
        self._rows: list[tuple[float, ...]] = []

    def tick(self, tick: Tick) -> None:
        """Keep one tick."""
        measured = tick.measurement
        self._rows.append(
            (
                tick.time_s,
                self._plant.displacement_mm,
                self._plant.temperature_c,
                measured.current_a,
                measured.voltage_v,
                bool(measured.limits),
            )
        )

    def error_row(self, planned: PlannedReference, stroke_mm: float) -> Row:
        """Return RMS and maximum of the tracking error after the approach, in % of the true stroke.

        They are NaN if the run ended during the approach.
        """
        time_s, reached_mm = self._columns()[:2]
        reference = planned.reference
        setpoint_mm = np.array([reference.value_mm(one_s) for one_s in time_s])
        percent = 100.0 * (setpoint_mm - reached_mm)[time_s >= reference.scored_from_s] / stroke_mm
        return dict(zip(("rms_percent", "max_percent"), rms_and_max(percent), strict=True))

    def heat_row(self) -> Row:
        """Return energy, highest true temperature, largest current, and the share of ticks at a limit."""
        time_s, _, temperature_c, current_a, voltage_v, limited = self._columns()
        if time_s.size == 0:
            return {}
        return {
            "energy_j": energy_j(time_s, current_a, voltage_v),
            "temperature_max_c": float(temperature_c.max()),
            "current_max_a": of_finite(np.max, current_a),
            "limited_percent": 100.0 * float(np.mean(limited)),
        }

    def _columns(self) -> np.ndarray:
        return np.array(self._rows).reshape(-1, 6).T


def tracking_row(run: PlannedRun, knowledge: WireKnowledge, log_file: Path | None = None) -> Row:
    """Track the reference of the run, and return its metrics. With `log_file`, also record the run in this log.

    A trip is a result: its row has the status `tripped`. Other errors are raised, for example a ConfigError if the
    displacement cannot come from the resistance.
    """
    assert run.reference is not None
    sim = simulated_wire(run)
    simulated = SimulatedRig(run, tracked_wire(run), TRACKING)
    wire = knowledge.wire.wire_model(simulated.rig.nominal_balance)
    planned = planned_reference(run.reference, wire, run.documents.rig)
    series = TickSeries(simulated)
    row = {**wire_row(sim), **knowledge.row, "smoothed": planned.smoothed}
    try:
        loop = _driven(run, simulated, wire, planned, knowledge, series, log_file)
    except TripError as trip:
        return {**row, **series.heat_row(), **outcome_row("tripped", trip)}
    counts = {"ticks": loop.ticks, "missed_deadlines": loop.missed_deadlines}
    return {**row, **series.error_row(planned, sim.wire.stroke_mm), **series.heat_row(), **counts}


def _driven(
    run: PlannedRun,
    simulated: SimulatedRig,
    wire: WireModel,
    planned: PlannedReference,
    knowledge: WireKnowledge,
    series: TickSeries,
    log_file: Path | None,
) -> LoopMetrics:
    """Run the controller on the simulated rig, and record the run if it has a log.

    The supervisor uses the identified wire for every controller, so that all controllers trip at the same limits.
    """
    with simulated.rig as rig:
        chosen = controller_of(run, knowledge, rig.usable(wire), planned.reference)
        controller = chosen.controller
        source = rig.config.displacement_from
        rig.check_sensing(wire, source, rig.measure().temperature_c)
        simulated.plan_disturbance(run.disturbance, planned.reference)
        log = nullcontext() if log_file is None else _recorder(log_file, run, rig, planned.reference, chosen)
        with log as recorder:

            def record(tick: Tick) -> None:
                series.tick(tick)
                if recorder is not None:
                    recorder.tick(tick)

            trusts_sensor = controller.trusts_sensor if isinstance(controller, TrackingController) else always
            return rig.drive(controller, wire.balance, record, wire_checks(wire, source, None, trusts_sensor))


def _recorder(log_file: Path, run: PlannedRun, rig: Rig, reference: Reference, chosen: RunController) -> TickRecorder:
    """Create the log of a tracking run, and return its recorder."""
    title = f"run {run.number} of a campaign: {run.settings.controller}, {dict(run.levels)}"
    seed = str(run.settings.seed)
    return record_tracking(log_file, rig, reference, chosen.wire, chosen.inverse, seed=seed, title=title)
