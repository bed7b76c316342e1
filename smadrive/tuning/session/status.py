"""The status: what a page shows besides the samples, as one JSON document."""

from __future__ import annotations

from collections import deque
from typing import Any

from smadrive.measurement import Measurement
from smadrive.rig.rig import Rig
from smadrive.safety.shutdown import shutdown_of
from smadrive.tuning.session.change_queue import ChangeQueue
from smadrive.tuning.session.swappable_controller import SwappableController
from smadrive.tuning.tuning import Tuning
from smadrive.wire.heat_balance import HeatBalance
from smadrive.wire.identified_wire import IdentifiedWire
from smadrive.wire.wire_model import travel_mm

STATUS_S = 0.1
"""How often it is published."""

EVENTS = 40
"""How many events a page can look back."""

LONGEST_EVENT = 400
"""Characters; all events together must have room in the status."""


class Status:
    """Collects what there is to tell: events, the open fault, a lost connection, the last measurement.

    `is_safe` until a try to make the heater safe has failed, and again when one has succeeded. `end` is None while the
    session lasts, then "off" if the devices have confirmed the safe state, otherwise "unconfirmed".
    """

    def __init__(self, rig: Rig, references: list[str], balance: HeatBalance, bench: ChangeQueue) -> None:
        self.fault: str | None = None
        self.fault_type: str | None = None
        self.lost: str | None = None
        self.is_safe = True
        self.end: str | None = None
        self.measured: Measurement | None = None
        self.events: deque[tuple[float, str]] = deque(maxlen=EVENTS)
        config = rig.config
        self._fixed = {
            "rig": config.name,
            "devices": {name: str(identity) for name, identity in rig.identities.items()},
            "rate_hz": config.rate_hz,
            "limits": {
                "current_max_a": config.limits.current_max_a,
                "temperature_max_c": config.limits.temperature_max_c,
            },
            "references": references,
        }
        self._balance = balance
        self._bench = bench
        self._told: tuple[Tuning, dict[str, Any]] | None = None

    def tell(self, time_s: float, event: str) -> None:
        """Add an event, the beginning of it if it is long."""
        if len(event) > LONGEST_EVENT:
            event = event[: LONGEST_EVENT - 1] + "…"
        self.events.append((round(time_s, 2), event))

    def clear_fault(self) -> None:
        """No fault is open any more."""
        self.fault = self.fault_type = None

    def fail(self, time_s: float, error: BaseException) -> None:
        """Take over what `error` says of the fault and of the heater."""
        outcome = shutdown_of(error)
        self.is_safe = outcome is None or outcome.confirmed
        self.fault = " — ".join([str(error), *getattr(error, "__notes__", ())])
        self.fault_type = type(error).__name__
        self.tell(time_s, self.fault)

    def document(self, live: SwappableController | None, *, adapts: bool) -> dict[str, Any]:
        """Everything as plain values."""
        bench, measured = self._bench, self.measured
        comparison = bench.comparison
        return {
            **self._fixed,
            "mode": _mode(live, is_safe=self.is_safe),
            "end": self.end,
            "fault": self.fault,
            "fault_type": self.fault_type,
            "lost": self.lost,
            "device_faults": [] if measured is None else measured.device_faults,
            "temperature_fault": None if measured is None else measured.temperature_fault,
            "limited_by": [] if measured is None else [*measured.device_limits, *measured.host_limits],
            "tuning": self._tuning(bench.in_force),
            "undo": bench.history.undo_name,
            "redo": bench.history.redo_name,
            "comparison": {
                "on": comparison.is_on,
                "turn": comparison.turn,
                "slots": {slot: tuning.change for slot, tuning in comparison.slots.items()},
                "scores": {slot: [score.mean_percent, len(score.cycles)] for slot, score in comparison.scores.items()},
            },
            "adapts": adapts,
            "events": list(self.events),
        }

    def _tuning(self, tuning: Tuning) -> dict[str, Any]:
        """Of the tuning in force; made once for each."""
        if self._told is None or self._told[0] is not tuning:
            certificate = tuning.model.certificate()
            document = {
                "wire": IdentifiedWire(tuning.model, self._balance).text(),
                "shape": tuning.shape._asdict(),
                "feedback": tuning.feedback.model_dump(),
                "change": tuning.change,
                "caveats": list(tuning.caveats),
                "travel_mm": travel_mm(tuning.model),
                "contraction_rate": certificate.contraction_rate,
                "invertible_percent": 100.0 * certificate.invertible_share,
            }
            self._told = tuning, document
        return self._told[1]


def _mode(live: SwappableController | None, *, is_safe: bool) -> str:
    if live is not None:
        return "tracking" if live.reference.endless else "holding"
    return "off" if is_safe else "off, unconfirmed"
