"""A tuning session on the simulated wire in virtual time, with a builder in this process and a scripted page."""

import json
from contextlib import nullcontext, suppress

import numpy as np
import pytest

from firmware_sim.bench import simulated_device
from firmware_sim.config import load_sim
from smadrive.clock import VirtualClock
from smadrive.control.references.shapes import sine
from smadrive.errors import SmadriveError
from smadrive.hysteresis import DuhemModel, TSFuzzyDuhem
from smadrive.hysteresis.fuzzy import TriangularSets
from smadrive.rig.config import load_rig
from smadrive.rig.rig import Rig
from smadrive.tuning.builder.build import BuildFailure, build
from smadrive.tuning.link.channel import DriverEnd, PageEnd
from smadrive.tuning.session.session import TuningSession
from smadrive.tuning.tuning import Tuning
from smadrive.wire.heat_balance import HeatBalance
from smadrive.wire.wire_properties import WireProperties

BALANCE = HeatBalance(0.0298, 0.014, 3.42e-5 * 24200.0, 22.0, 16.5, -0.12, 0.15)
REFERENCE = sine(low_mm=2.0, high_mm=9.0, period_s=40.0, cycles=1)
PERIOD_S = 0.05
DRIVING = ("arm", "track", "hold", "compare")

NONE_A = 0.002
"""The noise of the simulated current measurement."""

AFTER_OFF = "OFF was pressed after this click. Press again."
"""The answer to a request that was sent before an OFF and arrives after it."""


class DirectBuilder:
    """A builder that builds at once in this process. While `is_stopped`, it gives no result."""

    is_stopped = False

    def begin(self, request):
        try:
            self._result = build(request)
        except SmadriveError as error:
            self._result = BuildFailure(str(error))

    def result(self):
        return None if self.is_stopped else self._result


class Ended(BaseException):
    """The exception that ends a session, as Ctrl-C does."""


class TunedRig:
    """A rig on a simulated device with its session, the page's end of its channel, and the recorded ticks.

    `wire` is the true state of the plant at each tick: time, temperature and displacement. `trace_folder` and
    `stale_after_s` are those of the rig. `status` is the last status before the session is interrupted, `end` is
    that published afterwards. `recording(rig)` opens the log of the session; by default there is none. The front
    process sends a heartbeat at every tick unless `front_is_silent`.
    """

    trace_folder = None
    stale_after_s = 0.3
    front_is_silent = False
    recording = staticmethod(lambda _rig: nullcontext())

    def __init__(self, model, driver_end):
        self.device = simulated_device(load_sim("flexinol-lt-0.15mm"), seed=3)
        self.clock = VirtualClock()
        self.clock.follow(self.device.bench.advance_to)
        self.driver_end = driver_end
        self.page = PageEnd(self.driver_end.memory_fd, self.driver_end.page_socket)
        self.model = model
        self.properties = WireProperties(BALANCE)
        self.builder = DirectBuilder()
        self.ticks = []
        self.wire = []
        self.answers = {}
        self._interrupted = None
        self._script = []
        self._number = 0

    def at(self, time_s, act, **values):
        """Let the page send a request at `time_s`. Return its number, which is its key in `answers`.

        A request that drives the wire carries the count of all OFFs until then, unless `offs` is given.
        """
        self._number += 1
        message = {"number": self._number, "act": act, **values}

        def send():
            count = {"offs": self.page.offs} if act in DRIVING else {}
            self.page.send({**count, **message})

        self.do(time_s, send)
        return self._number

    def do(self, time_s, action):
        """Call `action` at `time_s`."""
        self._script.append((time_s, action))

    def run(self, until_s):
        """Run the session until `until_s`."""
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
            tuning = self.tuning(rig.config)
            references = {"sine": REFERENCE}
            given = rig, tuning, self.properties, references, self.driver_end, self.builder, record
            with self.recording(rig) as recorder:
                self.session = TuningSession(*given, recorder)
                self.session.run()

    def tuning(self, config):
        """Return the tuning at the start of a session with this rig file."""
        return Tuning.of(self.model, config.feedback, "as identified", (), config.displacement_from)

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
        """Return the RMS error of models against the true wire, in % of the stroke.

        Each model is compared over the last `over_s` before its time."""
        times_s, wire_c, reached_mm = np.array(self.wire).T
        errors = []
        for time_s, model in models:
            window = (times_s > time_s - over_s) & (times_s <= time_s)
            state = model.initial_state(wire_c[window][0], reached_mm[window][0])
            for v, mm in zip(wire_c[window].tolist(), reached_mm[window].tolist(), strict=True):
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


def currents(ticks):
    return np.array([tick.measurement.current_a for tick in ticks])


def error_mm(ticks):
    return np.array([tick.command.setpoint_mm - tick.measurement.displacement_mm for tick in ticks])


@pytest.fixture
def true_model():
    """The model of the simulated wire."""
    return true_wire()


@pytest.fixture
def driver_end():
    with DriverEnd() as driver_end:
        yield driver_end


@pytest.fixture
def rig(driver_end):
    return TunedRig(true_wire(), driver_end)


@pytest.fixture
def rig_without_zero(driver_end):
    """Makes a rig whose sensor reads `zero_mm` too much for its model; `seed` is that of its noise."""

    def make(zero_mm, seed=3):
        rig = TunedRig(true_wire(-zero_mm), driver_end)
        rig.device = simulated_device(load_sim("flexinol-lt-0.15mm"), seed)
        rig.clock.follow(rig.device.bench.advance_to)
        return rig

    return make


@pytest.fixture
def ruled_rig(driver_end):
    sets = TriangularSets((40.0, 60.0, 65.0, 70.0, 75.0, 80.0, 85.0, 90.0, 95.0, 100.0, 120.0))
    return TunedRig(TSFuzzyDuhem.from_duhem(true_wire(), sets), driver_end)
