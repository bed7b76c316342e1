"""No order of late, lost, doubled and early frames makes the client accept a foreign reply.

The benchmarks repeat this with more runs.
"""

import pytest
from hypothesis import settings
from hypothesis.stateful import run_state_machine_as_test
from marks import exhaustive
from modbus_model import BusMachine, NumberedBusMachine

from smadrive.modbus import requests
from smadrive.modbus.outstanding import LATEST_REPLY_S, Outstanding
from smadrive.modbus.requests import read_holding

SETTINGS = settings(max_examples=150, stateful_step_count=30, deadline=None)


@pytest.mark.parametrize("machine", [BusMachine, exhaustive(NumberedBusMachine)], ids=["rtu", "tcp"])
def test_no_foreign_reply_is_accepted(machine):
    run_state_machine_as_test(machine, settings=SETTINGS)


def test_model_detects_a_client_that_forgets_outstanding_replies(monkeypatch):
    """A late reply arrives while the client waits for the next reply of the same kind."""
    monkeypatch.setattr(Outstanding, "add", lambda *_: None)
    machine = BusMachine()
    machine.begin()
    machine.delay(late_s=0.25)
    machine.read(requests.read_holding, count=1, proved=False)
    with pytest.raises(AssertionError):
        machine.read(requests.read_holding, count=1, proved=False)


def test_busy_device_is_not_taken_for_one_that_ignores_unknown_reads():
    """The device answers neither the sync nor the read in time, then sends a second copy of an older reply."""
    machine = BusMachine()
    machine.begin()
    machine.double(copy_s=0.4, late_s=0.099)
    machine.delay(late_s=0.0)
    machine.refuse(after_all_s=None, code=1, copy_s=None, late_s=0.0)
    for proved in (False, False, True):
        machine.read(read_holding, count=1, proved=proved)
    machine.wait(LATEST_REPLY_S)
    machine.read(read_holding, count=1, proved=True)
    assert machine.device.answered
