"""A trip sets the current to zero before it is latched, because a slow disk must not prolong the heat."""

import signal
from functools import partial

import pytest

from firmware_sim.bench import simulated_device
from firmware_sim.config import load_sim
from smadrive.clock import VirtualClock
from smadrive.devices.heater import Heater
from smadrive.devices.state.latch import TripLatch
from smadrive.errors import SafetyError, StoppedError, TakenOverError, TripError
from smadrive.rig.config import load_rig
from smadrive.rig.rig import Rig
from smadrive.safety.faults import Fault
from smadrive.safety.shutdown import ShutdownOutcome, shutdown_of

HEATS_FROM_S = 3.0
LATCHED = "latched"


class Bench:
    """The shipped in-process rig, whose wire trips when it moves by 0.5 mm, with access to its simulated board."""

    def __init__(self):
        self.board = simulated_device(load_sim("flexinol-lt-0.15mm"), seed=3)
        clock = VirtualClock()
        clock.follow(self.board.bench.advance_to)
        config = load_rig("in-process")
        limits = config.limits.model_copy(update={"displacement_max_mm": 0.5})
        transports = {"board": self.board.transport(clock)}
        self.rig = Rig(config.model_copy(update={"limits": limits}), transports=transports)

    @property
    def commanded_a(self):
        return self.board.firmware.commanded_a

    def run_to_trip(self, record=lambda _tick: None):
        with pytest.raises(TripError) as trip:
            self.rig.excite(self.rig.excitation(22.0), record)
        return trip.value


@pytest.fixture
def bench():
    bench = Bench()
    with bench.rig:
        yield bench


@pytest.fixture
def commands(monkeypatch):
    """Return a list that gets the current of each exchange, and `LATCHED` for each latched trip."""
    made = []

    def noted(method, text, self, value):
        made.append(text or value)
        return method(self, value)

    for owner, name, text in ((Heater, "exchange", ""), (TripLatch, "latch", LATCHED)):
        spy = partial(noted, getattr(owner, name), text)
        monkeypatch.setattr(owner, name, lambda self, value, spy=spy: spy(self, value))
    return made


def test_current_is_zero_when_a_trip_is_latched(bench, monkeypatch):
    at_ticks_a, at_latch_a = [], []
    monkeypatch.setattr(TripLatch, "latch", lambda _self, _trip: at_latch_a.append(bench.commanded_a))
    trip = bench.run_to_trip(lambda tick: tick.tripped or at_ticks_a.append(bench.commanded_a))
    assert trip.number == Fault.OVER_DISPLACEMENT.number
    assert at_ticks_a[-1] > 0.05
    assert at_latch_a == [0.0]


def test_dead_line_delays_the_latch_by_one_exchange(bench, commands):
    def record(tick):
        if tick.time_s > HEATS_FROM_S:
            bench.board.faults.drop(for_s=1.0)

    assert bench.run_to_trip(record).number == Fault.STALE_DATA.number
    *_, lost_a, zero_a, latched = commands[: commands.index(LATCHED) + 1]
    assert lost_a > 0.05
    assert (zero_a, latched) == (0.0, LATCHED)


def test_signal_while_a_trip_is_written_does_not_replace_the_trip(bench, monkeypatch):
    latch, ticks = TripLatch.latch, []

    def interrupted_latch(self, trip):
        signal.raise_signal(signal.SIGINT)
        latch(self, trip)

    monkeypatch.setattr(TripLatch, "latch", interrupted_latch)
    trip = bench.run_to_trip(ticks.append)
    assert trip.number == Fault.OVER_DISPLACEMENT.number
    assert shutdown_of(trip) == ShutdownOutcome(None, (signal.SIGINT,), ended_run=True)
    assert bench.rig.latch.read() is not None
    assert ticks[-1].tripped


@pytest.mark.parametrize(
    "error",
    [TakenOverError("taken over"), SafetyError("no guardian"), OSError(), StoppedError("stopped"), None],
    ids=repr,
)
def test_failed_command_and_signal_do_not_replace_the_trip(bench, monkeypatch, error):
    exchange, begun = bench.rig.heater.source.exchange, []

    def fail_once(current_a, **options):
        if begun and current_a == 0.0:
            begun.clear()
            signal.raise_signal(signal.SIGINT)
            if error is not None:
                raise error
        return exchange(current_a, **options)

    monkeypatch.setattr(bench.rig.heater.source, "exchange", fail_once)
    trip = bench.run_to_trip(lambda tick: tick.tripped or tick.time_s < HEATS_FROM_S or begun.append(tick))
    assert not begun
    assert trip.number == Fault.OVER_DISPLACEMENT.number
    assert shutdown_of(trip) == ShutdownOutcome(None, (signal.SIGINT,), ended_run=True)
    assert bench.rig.latch.read() is not None
    assert bench.commanded_a == 0.0
