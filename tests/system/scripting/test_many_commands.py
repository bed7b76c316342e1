"""A script that commands its servo faster than the loop ticks delays no tick, and only its latest motion begins."""

from contextlib import nullcontext
from itertools import count

from smadrive.errors import MotionError
from smadrive.rig.config import load_rig
from smadrive.rig.rig import Rig
from smadrive.runs.experiments import drive
from smadrive.runs.log.reader import read_log
from smadrive.runs.run_kind import RunKind
from smadrive.scripting.loop.servo.controller import ServoController
from smadrive.scripting.loop.servo.messages import MoveCommand, StopCommand
from smadrive.wire.identified_wire import load_wire

TICKS = 5
MOST_COMMANDS = 10_000
"""Commands after which the test gives up: the loop has not ticked."""


class HurriedScript:
    """The link to a script whose next move is always ready. It stops the servo after `TICKS` ticks."""

    def __init__(self):
        self.ticks = []
        self.ended = []
        self._numbers = count(1)

    def next_command(self, _servo_id, *, waits):
        assert not waits
        if len(self.ticks) >= TICKS:
            return StopCommand()
        number = next(self._numbers)
        assert number < MOST_COMMANDS, "the loop takes commands for ever, and does not tick"
        return MoveCommand(number, 3.0, 1.0, 0.1, 0.5, 10.0)

    def report(self, report, *, waits):
        assert not waits
        self.ticks += report.ticks
        self.ended += report.ended
        return True


def recorded(recorder, _duration_s):
    return nullcontext(recorder.tick)


def test_loop_ticks_although_the_next_command_is_always_ready(identified, tmp_path):
    script, wire = HurriedScript(), load_wire(identified.wire_file)
    log_file, kind = tmp_path / "servo.h5", RunKind.SERVO
    with Rig(load_rig("in-process")) as rig:
        servo = ServoController(rig, wire, "servo", script, is_virtual=False)
        drive(log_file, rig, servo, kind, kind.value, wire, servo.watched(recorded), servo.stop_requested)
    assert len(script.ticks) == TICKS
    begun = [event for event in read_log(log_file).events if event.message.startswith("move to")]
    assert len(begun) == TICKS
    assert sorted(end.number for end in script.ended) == list(range(1, len(script.ended) + 1))
    assert {type(end.error) for end in script.ended} == {MotionError}
