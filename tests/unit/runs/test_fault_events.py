"""The log of a run has an event when faults and missing readings begin, and when they end."""

from math import nan

from smadrive.control.controllers.interface import Command
from smadrive.control.loop import Tick
from smadrive.measurement import Measurement
from smadrive.rig.config import load_rig
from smadrive.runs.log.reader import read_log
from smadrive.runs.run_kind import RunKind
from smadrive.runs.run_log import TickRecorder

RIGHT = Measurement(0.0, 80.0, 0.2, 3.3, 5.0)


def test_each_change_of_the_faults_is_an_event(tmp_path):
    without_current = RIGHT._replace(current_a=nan, supply_fault="no reply of the meters")
    measurements = [RIGHT, without_current, without_current, without_current._replace(device_faults=("estop",)), RIGHT]
    metadata = {"kind": RunKind.STEP.value, "rig": load_rig("in-process").model_dump_json()}
    with TickRecorder(tmp_path / "run.h5", metadata, rows=1) as recorder:
        for number, measurement in enumerate(measurements):
            recorder.tick(Tick(0.05 * number, 0.0, measurement, Command(0.2)))
    times_s, texts = zip(*read_log(tmp_path / "run.h5").events, strict=True)
    assert times_s == (0.05, 0.05 * 3, 0.05 * 4)
    assert "no reply of the meters" in texts[0]
    assert "estop" in texts[1]
    assert "cleared" in texts[2]
