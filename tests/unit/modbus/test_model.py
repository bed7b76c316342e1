"""No order of late, lost, doubled and early frames makes the client accept a foreign reply; more runs: benchmarks."""

import pytest
from hypothesis import settings
from hypothesis.stateful import run_state_machine_as_test
from modbus_model import BusMachine, NumberedBusMachine

from smadrive.modbus.outstanding import Outstanding

SETTINGS = settings(max_examples=150, stateful_step_count=30, deadline=None)


@pytest.mark.parametrize("machine", [BusMachine, NumberedBusMachine], ids=["rtu", "tcp"])
def test_no_foreign_reply_is_accepted(machine):
    run_state_machine_as_test(machine, settings=SETTINGS)


def test_the_model_finds_what_a_client_accepts_that_forgets_outstanding_replies(monkeypatch):
    monkeypatch.setattr(Outstanding, "add", lambda *_: None)
    with pytest.raises(AssertionError):
        run_state_machine_as_test(BusMachine, settings=settings(SETTINGS, max_examples=1000, print_blob=False))
