"""The source of a heat balance decides how strictly readings are checked, also for a copy of the balance."""

import json
from contextlib import suppress
from dataclasses import asdict, replace

import pytest

from smadrive.control.controllers.interface import Command
from smadrive.errors import TripError
from smadrive.hysteresis import DuhemModel
from smadrive.rig.config import load_rig
from smadrive.rig.rig import Rig
from smadrive.safety.faults import Fault
from smadrive.wire.heat_balance import BalanceSource, HeatBalance
from smadrive.wire.identified_wire import IdentifiedWire, parse_wire

WIRE = DuhemModel.gaussian(
    mu_heating=89.9, mu_cooling=69, sigma_heating=5, sigma_cooling=5, scale=12, input_range=(20, 130)
)
COPIES = {
    "same object": lambda balance: balance,
    "equal copy": replace,
    "from JSON": lambda balance: HeatBalance(**json.loads(json.dumps(asdict(balance)))),
    "from a saved wire": lambda balance: parse_wire(IdentifiedWire(WIRE, balance).text(), "status").heat_balance,
}


class Constant:
    """A controller that commands one current."""

    duration_s = 20.0

    def update(self, _time_s, _measurement, _dt_s):
        return Command(0.25)


def trip_of(copy, source, loss_factor):
    """Return the fault of a run whose heat balance has a multiple of the nominal loss; None without a trip."""
    with suppress(TripError), Rig(load_rig("in-process")) as rig:
        nominal = rig.nominal_balance
        wrong = replace(nominal, loss_w_per_k=loss_factor * nominal.loss_w_per_k, source=source)
        try:
            rig.drive(Constant(), copy(wrong), lambda _tick: None)
        except TripError as trip:
            return trip.number
    return None


@pytest.mark.parametrize("copy", COPIES.values(), ids=COPIES)
def test_copy_of_a_balance_is_checked_as_strictly_as_the_original(copy):
    assert trip_of(copy, BalanceSource.DATA_SHEET, 2.0) is None
    assert trip_of(copy, BalanceSource.IDENTIFIED, 2.0) == Fault.READS_TOO_HOT.number


def test_the_wire_file_gives_a_balance_of_the_data_sheet():
    assert Rig(load_rig("in-process")).nominal_balance.source is BalanceSource.DATA_SHEET
