"""A session heats only while the front process of the page, which answers OFF, beats in the channel."""

import pytest

from smadrive.errors import FrontSilentError
from smadrive.tuning.session.off_path import SILENT_S

NONE_A = 0.002
TICK_S = 0.05


def set_front_silent(bench, at_s, *, is_silent=True):
    bench.do(at_s, lambda: setattr(bench, "front_is_silent", is_silent))


def test_silent_front_switches_the_heater_off(bench):
    bench.at(1.0, "arm")
    bench.at(2.0, "track", reference="sine")
    set_front_silent(bench, 20.0)
    bench.run(until_s=30.0)
    assert any(tick.command.commanded_a > 0.1 for tick in bench.between(18.0, 20.0 + SILENT_S - 2 * TICK_S))
    after = bench.between(20.0 + SILENT_S + 4 * TICK_S, 30.0)
    assert not any(tick.measurement.armed or tick.measurement.current_a > NONE_A for tick in after)
    assert bench.status["mode"] == "off"
    assert bench.status["fault_type"] == FrontSilentError.__name__
    assert [event for _, event in bench.status["events"]].count(bench.status["fault"]) == 1


def test_silent_front_switches_off_although_every_reply_is_lost(bench):
    bench.stale_after_s = 5.0
    bench.at(1.0, "arm")
    bench.at(2.0, "track", reference="sine")
    set_front_silent(bench, 20.0)
    bench.do(20.0, lambda: bench.device.faults.drop(for_s=SILENT_S + 1.0))
    bench.run(until_s=30.0)
    assert bench.status["fault_type"] == FrontSilentError.__name__
    assert bench.status["mode"] == "off"


def test_short_pause_of_the_front_is_tolerated(bench):
    bench.at(1.0, "arm")
    set_front_silent(bench, 10.0)
    set_front_silent(bench, 10.0 + SILENT_S - 4 * TICK_S, is_silent=False)
    bench.run(until_s=15.0)
    assert bench.status["mode"] == "holding"


@pytest.mark.parametrize("silent_from_s", [0.0, 5.0])
def test_arm_is_refused_until_the_front_beats(bench, silent_from_s):
    if silent_from_s == 0.0:
        bench.front_is_silent = True
    set_front_silent(bench, silent_from_s)
    refused = bench.at(8.0, "arm")
    set_front_silent(bench, 10.0, is_silent=False)
    armed = bench.at(11.0, "arm")
    bench.run(until_s=12.0)
    assert bench.answers[refused] is not None
    assert not any(tick.measurement.armed for tick in bench.between(0.0, 10.9))
    assert bench.answers[armed] is None
    assert bench.status["mode"] == "holding"
    assert bench.status["fault_type"] is None
