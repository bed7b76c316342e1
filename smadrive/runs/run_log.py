"""The log of one run of a rig: its ticks become rows, its faults and limits events, everything it was run with texts.

What the controller was given and what it answered is all there, so that a replay can give it again.
"""

from __future__ import annotations

import json
import platform
from collections.abc import Mapping
from dataclasses import asdict
from importlib.metadata import version
from math import isfinite
from operator import attrgetter
from pathlib import Path

from smadrive.control.feedforward.displacement import DisplacementInverse, HysteresisInverse
from smadrive.control.loop import Tick
from smadrive.control.references.reference import Reference
from smadrive.hysteresis import DuhemModel, TSFuzzyDuhem
from smadrive.identification.excitation import Excitation
from smadrive.rig.rig import Rig
from smadrive.runs.log.writer import GROWTH_ROWS
from smadrive.runs.recorder import Recorder
from smadrive.wire.heat_balance import HeatBalance
from smadrive.wire.identified_wire import IdentifiedWire

COLUMNS = {
    "time_s": "time_s",
    "temperature_c": "measurement.temperature_c",
    "displacement_mm": "measurement.displacement_mm",
    "current_a": "measurement.current_a",
    "voltage_v": "measurement.voltage_v",
    "reference_mm": "command.setpoint_mm",
    "setpoint_c": "command.setpoint_c",
    "estimated_c": "command.estimated_c",
    "estimated_mm": "command.estimated_mm",
    "power_w": "command.power_w",
    "commanded_a": "command.current_a",
    "in_force_a": "measurement.commanded_a",
    "temperature_age_s": "measurement.temperature_age_s",
    "displacement_age_s": "measurement.displacement_age_s",
    "late_s": "late_s",
}
"""The columns of a log, and where in a tick each is found."""

LIMITED = "limited"
"""One column more: 1 where something held the output back; what it was is told by an event when it first does."""

_VALUES = attrgetter(*COLUMNS.values())
_PACKAGES = ("smadrive", "numpy", "scipy", "h5py", "pymodbus", "pyserial")


class TickRecorder(Recorder):
    """Takes the ticks of a loop: a row for each, and an event when a fault appears or a limit first holds it back."""

    def __init__(self, path: Path, about: Mapping[str, str], rows: int) -> None:
        super().__init__(path, (*COLUMNS, LIMITED), about, rows)
        self._told: set[str] = set()
        self._faults: tuple[str, ...] = ()

    def tick(self, tick: Tick) -> None:
        """Record one turn of the loop. DataError when the disk takes no more."""
        measurement = tick.measurement
        limits = measurement.device_limits + measurement.host_limits
        self.row((*_VALUES(tick), float(bool(limits))))
        faults = measurement.device_faults
        if measurement.temperature_fault is not None:
            faults = (*faults, f"thermocouple {measurement.temperature_fault}")
        if faults != self._faults:
            self._faults = faults
            self.event(f"faults: {', '.join(faults) or 'none any more'}")
        for limit in limits:
            if limit not in self._told:
                self._told.add(limit)
                self.event(f"limited by {limit} for the first time")


def record_excitation(path: Path, rig: Rig, excitation: Excitation, **notes: str) -> TickRecorder:
    """The log of an identification experiment; `notes` are texts that the rig does not know of, as a seed."""
    about = {"kind": "excitation", "excitation": json.dumps(asdict(excitation))}
    return _open(path, rig, {**about, **notes}, excitation.duration_s)


def record_tracking(
    path: Path,
    rig: Rig,
    reference: Reference,
    model: DuhemModel | TSFuzzyDuhem,
    balance: HeatBalance,
    inverse: DisplacementInverse,
    **notes: str,
) -> TickRecorder:
    """The log of a tracking run; `notes` are texts that the rig does not know of, as a seed."""
    about = {
        "kind": "tracking",
        "reference": reference_text(reference),
        "wire": IdentifiedWire(model, balance).text(),
        "inverse": "hysteresis" if isinstance(inverse, HysteresisInverse) else "plain map",
    }
    return _open(path, rig, {**about, **notes}, reference.duration_s)


def reference_text(reference: Reference) -> str:
    """JSON of a reference, approach included."""
    return json.dumps(
        {
            "times_s": reference.times_s.tolist(),
            "displacement_mm": reference.displacement_mm.tolist(),
            "scored_from_s": reference.scored_from_s,
            "endless": reference.endless,
        }
    )


def _open(path: Path, rig: Rig, about: Mapping[str, str], duration_s: float) -> TickRecorder:
    everywhere = {
        "rig": rig.config.model_dump_json(),
        "nominal_balance": json.dumps(asdict(rig.nominal_balance)),
        "devices": json.dumps({name: str(identity) for name, identity in rig.identities.items()}),
        "profiles": json.dumps({name: device.profile.model_dump(mode="json") for name, device in rig.devices.items()}),
        "versions": json.dumps({"python": platform.python_version(), **{name: version(name) for name in _PACKAGES}}),
        "machine": platform.platform(),
    }
    rows = int(duration_s / rig.period_s) + 1 if isfinite(duration_s) else GROWTH_ROWS
    return TickRecorder(path, {**everywhere, **about}, rows)
