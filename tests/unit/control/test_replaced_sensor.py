"""A displacement sensor that is replaced: nobody takes its readings for the displacement."""

from math import isnan, nan

import pytest

from smadrive.bluesky.readings import Readings, WireSample, alarm_of
from smadrive.cli.views.run_view import RunView
from smadrive.control.controllers.interface import Command
from smadrive.control.loop import Tick
from smadrive.measurement import Measurement
from smadrive.runs.log.recorder import Recorder
from smadrive.scripting.loop.messages import RunProgress
from smadrive.scripting.loop.servo.messages import MoveCommand
from smadrive.scripting.loop.servo.motions import MoveMotion
from smadrive.scripting.progress import progress_text
from smadrive.stream.samples import COLUMNS, row_of

VALID = Tick(1.0, 0.0, Measurement(1.0, 80.0, 0.2, 3.0, displacement_mm=4.0), Command(0.2, 80.0, 8.0, 80.0, 8.0))
REPLACED = VALID._replace(command=VALID.command._replace(uses_resistance=1.0, sensor_replaced=1.0))


@pytest.mark.parametrize(("tick", "reached_mm"), [(VALID, 4.0), (REPLACED, 8.0)])
def test_displacement_reached_is_then_the_estimated_one(tick, reached_mm):
    assert tick.reached_mm == reached_mm
    missing = tick._replace(measurement=Measurement(1.0, 80.0, 0.2, 3.0, displacement_mm=nan))
    assert missing.reached_mm == 8.0


def test_its_readings_are_no_measured_displacement():
    assert VALID.measured_mm == 4.0
    assert isnan(REPLACED.measured_mm)


@pytest.mark.parametrize(
    ("tick", "displacement", "error"),
    [(VALID, "displacement 4.000 mm", "error 4.000 mm"), (REPLACED, "estimated 8.000 mm", "error 0.000 mm")],
)
def test_terminal_shows_the_estimate_and_says_so(tmp_path, tick, displacement, error):
    with Recorder(tmp_path / "l.h5", ("time_s",)) as recorder:
        view = RunView("tracking", 10.0, 0.6, recorder)
        view.latest = tick
        shown = " ".join(str(view.__rich__()).split())
    assert displacement in shown
    assert error in shown


@pytest.mark.parametrize(("tick", "displacement"), [(VALID, "· 4.00 mm"), (REPLACED, "· estimated 8.00 mm")])
def test_progress_of_a_script_shows_the_estimate_and_says_so(tick, displacement):
    assert displacement in progress_text("tracking", RunProgress(tick, 10.0))


def test_its_readings_are_neither_published_nor_read():
    column = COLUMNS.index("displacement_mm")
    assert row_of(VALID, 0.0)[column] == 4.0
    assert isnan(row_of(REPLACED, 0.0)[column])
    readings = Readings("wire", "rig", ("temperature", "displacement"))
    assert readings.values(WireSample(VALID, 0.0))["wire_displacement_mm"] == 4.0
    assert isnan(readings.values(WireSample(REPLACED, 0.0))["wire_displacement_mm"])
    assert [alarm_of(WireSample(tick, 0.0)).severity for tick in (VALID, REPLACED)] == [0, 2]


@pytest.mark.parametrize(("setpoint_mm", "tick"), [(4.0, VALID), (8.0, REPLACED)])
def test_motion_is_done_at_the_displacement_reached(setpoint_mm, tick):
    motion = MoveMotion(MoveCommand(1, setpoint_mm, 1.0, 0.1, 0.5, 10.0), path_s=0.0)
    ends = [end for time_s in (0.0, 1.0) for end in motion.update(tick, time_s)]
    assert [end.error for end in ends] == [None]
