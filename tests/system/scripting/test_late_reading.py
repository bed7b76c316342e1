"""A servo whose script does not read in time: the ticks of a reference are still told from those around it."""

from contextlib import contextmanager

import numpy as np
import pytest

from smadrive.control.references.reference import Reference
from smadrive.rig.config import load_rig
from smadrive.rig.rig import Rig
from smadrive.runs.experiments import drive
from smadrive.runs.run_kind import RunKind
from smadrive.scripting.loop.servo.controller import ServoController
from smadrive.scripting.loop.servo.messages import FollowCommand, StopCommand
from smadrive.wire.identified_wire import load_wire

RAMP = Reference.from_samples([0.0, 5.0], [3.0, 5.0])
STALLED_TICKS = 300
"""The approach takes 200 ticks, the reference 100."""


class StalledScript:
    """The link to a script that commands RAMP, reads the first report after `STALLED_TICKS`, and stops the servo."""

    def __init__(self):
        self.ticks = []
        self.ended = []
        self._polls = 0

    def next_command(self, _servo_id, *, waits):
        assert not waits
        self._polls += 1
        if self._polls == 1:
            return FollowCommand(2, 1, RAMP)
        return StopCommand() if self._polls > STALLED_TICKS + 100 else None

    def report(self, report, *, waits):
        assert not waits
        if self._polls <= STALLED_TICKS:
            return False
        self.ticks += report.ticks
        self.ended += report.ended
        return True


@contextmanager
def watch(_recorder, _duration_s):
    yield lambda _tick: None


@pytest.mark.exhaustive
def test_ticks_that_have_piled_up_are_those_of_their_reference(identified, tmp_path):
    script, wire = StalledScript(), load_wire(identified.wire_file)
    with Rig(load_rig("in-process")) as rig:
        servo = ServoController(rig, wire, "servo", script, is_virtual=False)
        kind, log_file = RunKind.SERVO, tmp_path / "servo.h5"
        drive(log_file, rig, servo, kind, kind.value, wire, servo.watched(watch), servo.stop_requested)
    assert [(end.number, end.error) for end in script.ended] == [(1, None), (2, None)]
    assert {followed for _, followed in script.ticks} == {None, 2}
    setpoints_mm = [tick.command.setpoint_mm for tick, followed in script.ticks if followed == 2]
    np.testing.assert_allclose(setpoints_mm, np.linspace(3.0, 5.0, 101), atol=1e-6)
