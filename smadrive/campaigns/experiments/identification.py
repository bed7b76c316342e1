"""The identification of a run: an excitation on the simulated rig, or a record of the user, and the fit of the wire."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np

from smadrive.campaigns.experiments.columns import Row, Value
from smadrive.campaigns.experiments.simulated_rig import EXCITATION, SimulatedRig, simulated_wire, wire_row
from smadrive.campaigns.plan.plan import PlannedRun
from smadrive.control.loop import Tick
from smadrive.identification.excitation import ExcitationRecord
from smadrive.identification.wire import AnyFit, identify_wire
from smadrive.numerics.arrays import FloatArray
from smadrive.runs.experiments import plan_excitation
from smadrive.runs.record_fit import fit_file
from smadrive.wire.heat_balance import HeatBalance
from smadrive.wire.identified_wire import IdentifiedWire, load_wire
from smadrive.wire.wire_model import travel_mm


class WireKnowledge(NamedTuple):
    """The wire of a tracking run: the identified wire, the record it comes from, and the fit's metrics.

    The record is empty for a wire from a model file. `cpu_s` is the processor time of the identification.
    """

    wire: IdentifiedWire
    temperature_c: FloatArray
    displacement_mm: FloatArray
    row: Row
    cpu_s: float = 0.0


def excited_wire(run: PlannedRun) -> WireKnowledge:
    """Excite the simulated wire, and identify it. ConfigError, TripError or IdentificationError if that fails."""
    run = run._replace(documents=run.documents.for_excitation())
    simulated, ticks = SimulatedRig(run, simulated_wire(run), EXCITATION), list[Tick]()
    with simulated.rig as rig:
        rig.excite(plan_excitation(rig), ticks.append)
    record = _record(ticks)
    fit = identify_wire(record, rig.nominal_balance, run.settings.fit.settings())
    row = _fit_row(fit.hysteresis, fit.thermal.balance, float(record.time_s[-1]))
    return WireKnowledge(fit.wire, fit.thermal.wire_temperature_c, record.displacement_mm, row)


def wire_of_model(path: str) -> WireKnowledge:
    """Return the wire in a model file. ModelError if it is unusable."""
    return WireKnowledge(load_wire(path), np.array([]), np.array([]), {})


def identification_row(run: PlannedRun, knowledge: WireKnowledge) -> Row:
    """Return the metrics of a run that only identifies its wire."""
    return {**wire_row(simulated_wire(run)), **knowledge.row}


def fit_row(run: PlannedRun) -> Row:
    """Fit the record of a run, and return the metrics of the fit."""
    assert run.settings.record is not None
    fit = run.settings.fit
    result = fit_file(Path(run.settings.record), (fit.input, fit.output), fit.settings())
    balance = None if result.thermal is None else result.thermal.balance
    return _fit_row(result.fit, balance, float("nan"))


def _record(ticks: list[Tick]) -> ExcitationRecord:
    """Return the record of an excitation, without the ticks in which a value is missing."""
    measured = [tick.measurement for tick in ticks]
    rows = np.array(
        [
            (tick.time_s, one.current_a, one.voltage_v, one.temperature_c, one.displacement_mm)
            for tick, one in zip(ticks, measured, strict=True)
        ]
    )
    return ExcitationRecord(*rows[np.isfinite(rows).all(axis=1)].T)


def _fit_row(fit: AnyFit, balance: HeatBalance | None, record_s: float) -> Row:
    row: dict[str, Value] = {
        "fit_rms_percent": fit.rms_percent,
        "fit_max_percent": fit.max_percent,
        "certified": bool(fit.certificate.holds),
        "excitation_s": record_s,
        "identified_stroke_mm": travel_mm(fit.model).stroke_mm,
    }
    names = ("heat_capacity_j_per_k", "loss_w_per_k", "latent_heat_j", "resistance_cold_ohm")
    return row if balance is None else row | {f"identified_{name}": getattr(balance, name) for name in names}
