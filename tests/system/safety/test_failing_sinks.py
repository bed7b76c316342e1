"""A record, log or display may fail at any step: the current still ends at zero and the trip is still reported."""

import errno
import os

import pytest
from marks import exhaustive
from rich.console import Console

from firmware_sim.bench import SimulatedBench
from firmware_sim.config import load_sim
from smadrive.cli.views.run_view import RunView, drawing
from smadrive.clock import VirtualClock
from smadrive.control.controllers.interface import Command
from smadrive.errors import SafetyError, TripError
from smadrive.rig.config import RigConfig, load_rig
from smadrive.runs.run_log import record_excitation
from smadrive.safety.shutdown import shutdown_of
from tests.on_bench import rig_on

TICKS = 40
FAILURES = [OSError(errno.ENOSPC, "full"), BrokenPipeError(), MemoryError(), ValueError("closed"), SystemExit(1)]
SUPPLY = [
    {"name": "supply", "profile": "riden-rd60xx", "url": "sim://bench"},
    {"name": "reader", "profile": "autonics-tk", "url": "sim://bench"},
]


class Constant:
    """A controller that commands one current for `TICKS` ticks."""

    def __init__(self, period_s):
        self.duration_s = TICKS * period_s

    def update(self, _time_s, _measurement, _dt_s):
        return Command(0.2)


class Scene:
    """A rig and its simulated bench."""

    def __init__(self, kind):
        base = load_rig("in-process").model_dump(exclude_none=True)
        if kind == "supply":
            base |= {"devices": SUPPLY, "rate_hz": 4.0}
            base["limits"] |= {"current_max_a": 0.4, "voltage_max_v": 15.0, "watchdog_s": 1.0, "stale_after_s": 2.0}
        config = RigConfig.model_validate(base)
        self.bench = SimulatedBench(load_sim("flexinol-lt-0.15mm"), seed=5)
        clock = VirtualClock()
        clock.follow(self.bench.advance_to)
        self.rig = rig_on(self.bench, config, clock)

    def drive(self, rig, record):
        return rig.drive(Constant(rig.period_s), rig.nominal_balance, record)

    def failure(self, kind, folder, run):
        """The error of type `kind` that ends `run(rig, recorder)`."""
        with (
            pytest.raises(kind) as caught,
            self.rig as rig,
            record_excitation(folder / "l.h5", rig, rig.excitation(22.0)) as recorder,
        ):
            run(rig, recorder)
        return caught.value


@pytest.fixture(params=["board", "supply"])
def scene(request):
    return Scene(request.param)


@pytest.mark.parametrize("at_tick", [exhaustive(0), TICKS // 2, exhaustive(TICKS)])
@pytest.mark.parametrize("failure", FAILURES, ids=lambda failure: type(failure).__name__)
def test_a_record_that_fails_at_any_tick_ends_the_run_without_current(scene, failure, at_tick):
    left = [at_tick]

    def record(_tick):
        left[0] -= 1
        if left[0] < 0:
            raise failure

    with pytest.raises(type(failure)) as caught, scene.rig as rig:
        scene.drive(rig, record)
    assert caught.value is failure
    assert shutdown_of(caught.value).confirmed
    assert scene.bench.plant.current_a == 0.0


def test_a_log_whose_file_fails_at_its_end_does_not_hide_the_trip(scene, tmp_path):
    def run(rig, recorder):
        def record(tick):
            recorder.tick(tick)
            if tick.time_s > 1.0:
                os.close(recorder._file._handle)
                raise TripError("trip", 3)

        scene.drive(rig, record)

    error = scene.failure(TripError, tmp_path, run)
    assert shutdown_of(error).confirmed
    assert len(error.__notes__) == 1


class FailingTerminal:
    """A terminal that disappears after some writes."""

    encoding = "utf-8"

    def __init__(self, writes):
        self._left = writes

    def write(self, text):
        self._left -= 1
        if self._left < 0:
            raise OSError(errno.EIO, "the terminal is gone")
        return len(text)

    def flush(self):
        pass

    def isatty(self):
        return True


@pytest.mark.parametrize("writes", [0, 1, 2, 3, 100])
def test_a_terminal_that_is_gone_hides_no_trip(scene, tmp_path, writes):
    console = Console(file=FailingTerminal(writes), force_terminal=True)

    def run(rig, recorder):
        with drawing(RunView("exciting", 10.0, 0.6, recorder), console):
            scene.bench.sensors.faults.open_thermocouple()
            rig.clock.sleep_until(rig.clock.now_s() + 1.0)
            scene.drive(rig, recorder.tick)

    error = scene.failure(SafetyError, tmp_path, run)
    assert shutdown_of(error).confirmed
