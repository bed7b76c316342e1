"""OFF of the tuning page gives zero current, is confirmed, and wins over earlier requests."""

import signal
from itertools import pairwise

import pytest

from smadrive.errors import DataError
from smadrive.safety.shutdown import UNCONFIRMED
from tests.unit.tuning.conftest import AFTER_OFF, NONE_A, Ended, currents


@pytest.mark.parametrize("way", ["counter", "message"])
def test_off_ends_with_zero_current_within_two_periods(rig, way):
    rig.at(1.0, "arm")
    rig.at(2.0, "track", reference="sine")
    if way == "counter":
        rig.do(20.0, rig.page.request_off)
    else:
        rig.at(20.0, "off")
    rig.run(until_s=22.0)
    assert currents(rig.between(15.0, 20.0)).min() > 0.1
    assert currents(rig.between(20.11, 22.0)).max() < NONE_A
    assert rig.status["mode"] == "off"


@pytest.fixture
def modes(rig):
    """A function that returns the published modes, without repetitions."""
    seen = []
    rig.clock.follow(lambda _: seen.append(rig.driver_end.published.get("mode")))
    return lambda: [mode for before, mode in pairwise(seen) if mode != before]


@pytest.mark.parametrize("at_s", [1.0, 1.05], ids=["published at once", "published later"])
@pytest.mark.parametrize("way", ["counter", "message"])
def test_off_while_the_heater_is_off_raises_no_alarm(rig, modes, way, at_s):
    if way == "counter":
        rig.do(at_s, rig.page.request_off)
    else:
        rig.at(at_s, "off")
    rig.run(until_s=3.0)
    assert modes() == ["off"]
    assert [event for _, event in rig.status["events"]] == ["OFF", "heater off, confirmed"]


def test_unconfirmed_off_is_published_and_retried_until_confirmed(rig, modes):
    rig.do(1.0, lambda: rig.device.faults.vanish(3.0))
    rig.do(1.0, rig.page.request_off)
    rig.run(until_s=8.0)
    assert modes() == ["off", "off, unconfirmed", "off"]
    assert [event for _, event in rig.status["events"]] == ["OFF", "heater off, confirmed"]


def test_arm_is_refused_until_the_heater_is_confirmed_off(rig):
    rig.do(1.0, lambda: rig.device.faults.vanish(3.0))
    rig.do(1.0, rig.page.request_off)
    early, late = 99, rig.at(6.0, "arm")
    messages = [{"number": early, "act": "arm"}]

    def send(now_s):
        rig.page.beat_front()
        if now_s > 3.0 and messages:
            rig.page.send({"offs": rig.page.offs, **messages.pop()})

    rig.clock.follow(send)
    rig.run(until_s=8.0)
    assert UNCONFIRMED in rig.answers[early]
    assert rig.answers[late] is None
    assert rig.status["mode"] == "holding"


def test_unrelated_note_on_an_error_raises_no_alarm(rig, modes):
    def fail():
        error = DataError("the log takes no more")
        error.add_note("its folder is gone")
        raise error

    rig.at(1.0, "arm")
    rig.do(2.0, fail)
    rig.run(until_s=4.0)
    assert modes() == ["off", "holding", "off"]
    assert "its folder is gone" in rig.status["fault"]


@pytest.mark.parametrize("acts", [(), ("arm",)], ids=["idle", "heating"])
@pytest.mark.parametrize(("silent_s", "end"), [(0.0, "off"), (600.0, "unconfirmed")])
def test_end_of_the_session_publishes_whether_the_heater_is_confirmed_off(rig, acts, silent_s, end):
    for act in acts:
        rig.at(1.0, act)
    seen = []
    rig.do(2.0, lambda: seen.append(rig.status["end"]))
    rig.do(3.0, lambda: rig.device.faults.vanish(silent_s))
    rig.run(until_s=3.0)
    assert seen == [None]
    assert rig.end == end


@pytest.fixture
def interrupts():
    """A function that sends the signal of Ctrl-C, which raises Ended unless signals are held."""

    def end(_number, _frame):
        raise Ended

    before = signal.signal(signal.SIGINT, end)
    yield lambda: signal.raise_signal(signal.SIGINT)
    signal.signal(signal.SIGINT, before)


def test_signal_while_the_session_ends_does_not_prevent_the_confirmation(rig, interrupts):
    pending = []
    rig.clock.follow(lambda _now_s: pending.pop()() if pending else None)
    rig.do(3.0, lambda: pending.append(interrupts))
    rig.run(until_s=3.0)
    assert pending == []
    assert rig.end == "off"


def test_arm_after_off_is_accepted(rig):
    rig.at(1.0, "arm")
    rig.at(2.0, "track", reference="sine")
    rig.do(20.0, rig.page.request_off)
    again = rig.at(21.0, "arm")
    rig.run(until_s=23.0)
    assert rig.answers[again] is None
    assert rig.status["mode"] == "holding"


def test_requests_sent_before_off_do_not_act_after_it(rig):
    rig.at(1.0, "arm")
    rig.at(2.0, "track", reference="sine")
    rig.do(20.0, rig.page.request_off)
    again = [rig.at(22.0, "arm") for _ in range(6)]
    rig.do(22.0, rig.page.request_off)
    rig.run(until_s=30.0)
    assert rig.status["mode"] == "off"
    assert currents(rig.between(20.5, 30.0)).max() < NONE_A
    assert all(AFTER_OFF in rig.answers[arm] for arm in again)


@pytest.mark.parametrize("late_s", [0.0, 1.0])
def test_off_wins_over_an_arm_that_does_not_know_of_it(rig, late_s):
    rig.do(1.0, rig.page.request_off)
    rig.do(1.0, rig.page.request_off)
    overtaken = [rig.at(1.0 + late_s, "arm", offs=offs) for offs in (0, 1)]
    rig.run(until_s=4.0)
    assert [rig.answers[arm] for arm in overtaken] == [AFTER_OFF] * 2
    assert not any(tick.measurement.armed for tick in rig.ticks)
    again = rig.at(5.0, "arm")
    rig.run(until_s=6.0)
    assert rig.answers[again] is None
    assert rig.status["mode"] == "holding"


def test_arm_with_a_count_of_offs_that_is_too_high_is_refused(rig):
    arm = rig.at(1.0, "arm", offs=1)
    rig.run(until_s=3.0)
    assert rig.answers[arm] == AFTER_OFF
    assert not any(tick.measurement.armed for tick in rig.ticks)


def test_arm_that_knows_of_an_off_in_the_same_tick_is_accepted(rig):
    rig.at(1.0, "arm")
    rig.do(2.0, rig.page.request_off)
    rig.run(until_s=3.0)
    rig.do(4.0, rig.page.request_off)
    arm = rig.at(4.0, "arm")
    rig.run(until_s=6.0)
    assert rig.answers[arm] is None
    assert rig.status["mode"] == "holding"


@pytest.mark.parametrize(("act", "values"), [("track", {"reference": "sine"}), ("hold", {}), ("compare", {"on": True})])
def test_off_wins_over_every_driving_request_that_does_not_know_of_it(rig, act, values):
    rig.do(1.0, rig.page.request_off)
    rig.at(2.0, "arm")
    overtaken = rig.at(3.0, act, offs=0, **values)
    rig.run(until_s=5.0)
    assert rig.answers[overtaken] == AFTER_OFF
    assert rig.status["mode"] == "holding"


def test_every_arm_is_answered_although_off_comes_before_the_wire_is_held(rig):
    arms = [rig.at(1.0, "arm"), rig.at(1.0, "arm")]
    off = rig.at(1.0, "off")
    rig.run(until_s=3.0)
    first, second = (rig.answers[arm] for arm in arms)
    assert "switched off in the meantime" in first
    assert "armed already" in second
    assert rig.answers[off] is None
    assert rig.status["mode"] == "off"
    assert currents(rig.ticks).max() < NONE_A
