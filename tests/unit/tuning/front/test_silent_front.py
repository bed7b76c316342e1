"""A session heats only while the front process of the page, which answers OFF, sends heartbeats."""

import pytest
from marks import exhaustive

from smadrive.errors import FrontSilentError
from smadrive.tuning.session.off_path import SILENT_S
from tests.unit.tuning.conftest import NONE_A

TICK_S = 0.05


def set_front_silent(rig, at_s, *, is_silent=True):
    rig.do(at_s, lambda: setattr(rig, "front_is_silent", is_silent))


def test_silent_front_switches_the_heater_off(rig):
    rig.at(1.0, "arm")
    rig.at(2.0, "track", reference="sine")
    set_front_silent(rig, 20.0)
    rig.run(until_s=30.0)
    assert any(tick.command.commanded_a > 0.1 for tick in rig.between(18.0, 20.0 + SILENT_S - 2 * TICK_S))
    after = rig.between(20.0 + SILENT_S + 4 * TICK_S, 30.0)
    assert not any(tick.measurement.armed or tick.measurement.current_a > NONE_A for tick in after)
    assert rig.status["mode"] == "off"
    assert rig.status["fault_type"] == FrontSilentError.__name__
    assert [event for _, event in rig.status["events"]].count(rig.status["fault"]) == 1


def test_silent_front_switches_off_although_every_reply_is_lost(rig):
    rig.stale_after_s = 5.0
    rig.at(1.0, "arm")
    rig.at(2.0, "track", reference="sine")
    set_front_silent(rig, 20.0)
    rig.do(20.0, lambda: rig.device.faults.drop(for_s=SILENT_S + 1.0))
    rig.run(until_s=30.0)
    assert rig.status["fault_type"] == FrontSilentError.__name__
    assert rig.status["mode"] == "off"


@pytest.mark.exhaustive
def test_short_pause_of_the_front_is_tolerated(rig):
    rig.at(1.0, "arm")
    set_front_silent(rig, 10.0)
    set_front_silent(rig, 10.0 + SILENT_S - 4 * TICK_S, is_silent=False)
    rig.run(until_s=15.0)
    assert rig.status["mode"] == "holding"


@pytest.mark.parametrize("silent_from_s", [exhaustive(0.0), 5.0])
def test_arm_is_refused_until_the_front_process_answers(rig, silent_from_s):
    if silent_from_s == 0.0:
        rig.front_is_silent = True
    set_front_silent(rig, silent_from_s)
    refused = rig.at(8.0, "arm")
    set_front_silent(rig, 10.0, is_silent=False)
    armed = rig.at(11.0, "arm")
    rig.run(until_s=12.0)
    assert rig.answers[refused] is not None
    assert not any(tick.measurement.armed for tick in rig.between(0.0, 10.9))
    assert rig.answers[armed] is None
    assert rig.status["mode"] == "holding"
    assert rig.status["fault_type"] is None
