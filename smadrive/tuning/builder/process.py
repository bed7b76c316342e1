"""The workshop process: it works on what the loop orders until its standard input ends."""

from __future__ import annotations

import select
import sys
from typing import Any

from smadrive.errors import SmadriveError
from smadrive.tuning.builder.builder import Models, Outcome, Refused, packed_outcome, prepare, unpacked_order
from smadrive.tuning.link.child import report_ready, run
from smadrive.tuning.link.mailbox import Parcel, Parcels, other_end


def serve(told: dict[str, Any]) -> None:
    """Serve until standard input ends."""
    parcels, models = other_end(tuple(told["fds"])), Models()
    report_ready()
    while True:
        readable, _, _ = select.select([sys.stdin, parcels.messages], [], [])
        if sys.stdin in readable:
            return
        parcel = parcels.received()
        if parcel is not None:
            work(parcel, parcels, models)


def work(parcel: Parcel, parcels: Parcels, models: Models) -> None:
    """Do one order. What goes wrong is the outcome, whatever it is: the loop waits for one."""
    order = unpacked_order(parcel.content, models)
    outcome: Outcome
    try:
        outcome = prepare(order)
        models.keep(outcome.tuning.model)
    except SmadriveError as refusal:
        outcome = Refused(str(refusal))
    except Exception as defect:  # noqa: BLE001
        outcome = Refused(f"the workshop could not do it: {defect!r}")
    parcels.send(parcel.number, packed_outcome(outcome, order))


if __name__ == "__main__":
    run(serve)
