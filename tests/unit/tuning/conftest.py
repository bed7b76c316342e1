"""A tuning session on the simulated wire in virtual time, its workshop in line, and a page that follows a script."""

import json
from contextlib import suppress

import numpy as np
import pytest

from firmware_sim.bench import simulated_device
from firmware_sim.config import load_sim
from smadrive.clock import VirtualClock
from smadrive.control.references.shapes import sine
from smadrive.errors import SmadriveError
from smadrive.hysteresis import DuhemModel, TSFuzzyDuhem
from smadrive.hysteresis.fuzzy import TriangularSets
from smadrive.rig.config import FeedbackConfig, load_rig
from smadrive.rig.rig import Rig
from smadrive.tuning.builder.builder import Refused, prepare
from smadrive.tuning.link.channel import ControlEnd, PageEnd
from smadrive.tuning.session.session import TuningSession
from smadrive.tuning.tuning import Tuning
from smadrive.wire.heat_balance import HeatBalance

BALANCE = HeatBalance(0.0298, 0.014, 3.42e-5 * 24200.0, 22.0, 16.5, -0.12, 0.15)
REFERENCE = sine(low_mm=2.0, high_mm=9.0, period_s=40.0, cycles=1)
PERIOD_S = 0.05
DRIVING = ("arm", "track", "hold", "compare")


class InLine:
    """A workshop that does the work at once; nothing comes out of it while it `stands_still`."""

    stands_still = False

    def begin(self, order):
        try:
            self._outcome = prepare(order)
        except SmadriveError as refusal:
            self._outcome = Refused(str(refusal))

    def outcome(self):
        return None if self.stands_still else self._outcome


class Ended(BaseException):
    """Ends a session as Ctrl-C does."""


class Bench:
    """The session, the page's end of its channel, the simulated device, and the ticks that were recorded.

    `wire` is what was true at each of them: time, temperature and displacement of the plant. `trace_folder` and
    `stale_after_s` are those of the rig. `status` is what has been published when the session is interrupted, `end`
    what it publishes afterwards. The front process beats at every tick unless it `front_is_silent`.
    """

    trace_folder = None
    stale_after_s = 0.3
    front_is_silent = False

    def __init__(self, model, control):
        self.device = simulated_device(load_sim("flexinol-lt-0.15mm"), seed=3)
        self.clock = VirtualClock()
        self.clock.follow(self.device.bench.advance_to)
        self.control = control
        self.page = PageEnd(self.control.memory_fd, self.control.page_socket)
        self.model = model
        self.workshop = InLine()
        self.ticks = []
        self.wire = []
        self.answers = {}
        self._interrupted = None
        self._script = []
        self._number = 0

    def at(self, time_s, act, **values):
        """Have the page ask for something at `time_s`; the number by which its answer is known.

        What drives the wire is asked knowing of every OFF until then, unless `offs` tells of how many.
        """
        self._number += 1
        message = {"number": self._number, "act": act, **values}

        def ask():
            known = {"offs": self.page.offs} if act in DRIVING else {}
            self.page.send({**known, **message})

        self.do(time_s, ask)
        return self._number

    def do(self, time_s, action):
        """Have anything happen at `time_s`."""
        self._script.append((time_s, action))

    def run(self, until_s):
        """The session's life."""
        self._interrupted = None
        script = sorted(self._script, key=lambda entry: entry[0])

        def record(tick):
            self.ticks.append(tick)
            plant = self.device.bench.plant
            self.wire.append((tick.measurement.time_s, plant.temperature_c, plant.displacement_mm))
            while script and script[0][0] <= tick.measurement.time_s:
                script.pop(0)[1]()
            self._read()
            if not self.front_is_silent:
                self.page.beat_front()
            if tick.measurement.time_s >= until_s:
                self._interrupted = self._published
                raise Ended

        with (
            suppress(Ended),
            Rig(self._config(), None, {"board": self.device.transport(self.clock)}, self.trace_folder) as rig,
        ):
            tuning = Tuning.of(self.model, FeedbackConfig(), "as identified")
            references = {"sine": REFERENCE}
            self.session = TuningSession(rig, tuning, BALANCE, references, self.control, self.workshop, record)
            self.session.run()

    def _config(self):
        config = load_rig("in-process")
        limits = config.limits.model_copy(update={"stale_after_s": self.stale_after_s})
        return config.model_copy(update={"limits": limits})

    def _read(self):
        for message in self.page.received(100):
            answer = json.loads(message)
            self.answers[answer["number"]] = answer["refused"]

    @property
    def status(self):
        return self._interrupted or self._published

    @property
    def end(self):
        return self._published["end"]

    @property
    def _published(self):
        return self.page.status(seen=-1)[1]

    def rms_percent(self, models, over_s=40.0):
        """How far each model is off the true wire in the time before its own, all together, in % of the stroke."""
        times_s, wire_c, reached_mm = np.array(self.wire).T
        errors = []
        for time_s, model in models:
            there = (times_s > time_s - over_s) & (times_s <= time_s)
            state = model.initial_state(wire_c[there][0], reached_mm[there][0])
            for v, mm in zip(wire_c[there].tolist(), reached_mm[there].tolist(), strict=True):
                state = model.step(state, v)
                errors.append(100.0 * (state.y - mm) / 12.0)
        return float(np.sqrt(np.mean(np.square(errors))))

    def between(self, from_s, to_s):
        return [tick for tick in self.ticks if from_s <= tick.measurement.time_s < to_s]


def true_wire(offset_mm=0.0):
    return DuhemModel.gaussian(
        mu_heating=89.9,
        mu_cooling=69.0,
        sigma_heating=5.0,
        sigma_cooling=5.0,
        scale=12.0,
        offset=offset_mm,
        input_range=(0.0, 200.0),
    )


@pytest.fixture
def true_model():
    """What the simulated wire does."""
    return true_wire()


@pytest.fixture
def control():
    with ControlEnd() as control:
        yield control


@pytest.fixture
def bench(control):
    return Bench(true_wire(), control)


@pytest.fixture
def bench_without_zero(control):
    """Makes a bench whose sensor reads so many mm too much for its model, with noise of its own."""

    def make(zero_mm, seed=3):
        bench = Bench(true_wire(-zero_mm), control)
        bench.device = simulated_device(load_sim("flexinol-lt-0.15mm"), seed)
        bench.clock.follow(bench.device.bench.advance_to)
        return bench

    return make


@pytest.fixture
def ruled_bench(control):
    sets = TriangularSets((40.0, 60.0, 65.0, 70.0, 75.0, 80.0, 85.0, 90.0, 95.0, 100.0, 120.0))
    return Bench(TSFuzzyDuhem.from_duhem(true_wire(), sets), control)
