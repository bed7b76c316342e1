"""The control side of the tuning page on the simulated wire: what a page may do, and what it cannot."""

from itertools import pairwise

import numpy as np
import pytest

from firmware_sim.bench import simulated_device
from firmware_sim.config import load_sim
from smadrive.control.references.reference import Reference
from smadrive.errors import ConfigError, DataError
from smadrive.tuning.session.reference_catalogue import ReferenceCatalogue
from smadrive.wire.identified_wire import parse_wire
from tests.unit.tuning.conftest import REFERENCE

NONE_A = 0.002
"""The noise of the simulated current measurement."""


def currents(ticks):
    return np.array([tick.measurement.current_a for tick in ticks])


def error_mm(ticks):
    return np.array([tick.command.setpoint_mm - tick.measurement.displacement_mm for tick in ticks])


def test_idle_it_measures_and_does_not_heat(bench):
    bench.run(until_s=3.0)
    assert len(bench.ticks) == pytest.approx(60, abs=2)
    assert currents(bench.ticks).max() < NONE_A
    assert bench.status["mode"] == "off"
    assert len(bench.page.since(0)[1]) == bench.page.written >= 58


def test_armed_it_holds_then_follows_a_reference_again_and_again(bench):
    arm, start = bench.at(1.0, "arm"), bench.at(2.0, "track", reference="sine")
    bench.run(until_s=140.0)
    assert bench.answers == {arm: None, start: None}
    assert bench.status["mode"] == "tracking"
    assert np.abs(error_mm(bench.between(60.0, 139.0))).max() < 0.03 * 12.0
    assert np.ptp([tick.command.setpoint_mm for tick in bench.between(100.0, 139.0)]) == pytest.approx(7.0, abs=0.1)


@pytest.mark.parametrize("seed", range(4))
def test_a_cold_wire_is_armed_without_heat_and_approaches_smoothly_whatever_its_sensors_noise(bench, seed):
    bench.device = simulated_device(load_sim("flexinol-lt-0.15mm"), seed)
    bench.clock.follow(bench.device.bench.advance_to)
    bench.at(1.0, "arm")
    bench.at(5.0, "track", reference="sine")
    bench.run(until_s=15.0)
    assert bench.between(2.0, 5.0)[0].measurement.armed
    assert currents(bench.between(0.0, 5.0)).max() < NONE_A
    assert np.abs(error_mm(bench.between(5.0, 15.0))).max() < 0.01 * 12.0


@pytest.mark.parametrize("noise_seed", range(3))
@pytest.mark.parametrize("zero_mm", [-0.6, -0.05, 0.05, 0.6])
def test_a_cold_wire_is_held_without_heat_although_its_sensor_has_lost_its_zero(
    bench_without_zero, zero_mm, noise_seed
):
    bench = bench_without_zero(zero_mm, noise_seed)
    bench.at(1.0, "arm")
    bench.run(until_s=20.0)
    assert bench.between(2.0, 20.0)[0].measurement.armed
    assert currents(bench.between(0.0, 20.0)).max() < NONE_A


def test_a_sensor_that_is_far_from_where_the_wire_can_be_is_not_armed(bench_without_zero):
    bench = bench_without_zero(6.0)
    arm = bench.at(1.0, "arm")
    bench.run(until_s=3.0)
    assert "mm possible at 2" in bench.status["fault"]
    assert bench.answers[arm] == bench.status["fault"]
    assert "armed, holding" not in [event for _, event in bench.status["events"]]
    assert currents(bench.ticks).max() < NONE_A


def test_a_warm_wire_is_held_where_it_is(bench):
    bench.at(1.0, "arm")
    bench.at(2.0, "track", reference="sine")
    bench.do(20.0, bench.page.request_off)
    bench.at(20.3, "arm")
    bench.run(until_s=24.0)
    held = bench.between(21.0, 24.0)
    assert held[0].command.setpoint_mm > 1.0
    assert np.abs(error_mm(held)).max() < 0.03 * 12.0


@pytest.mark.parametrize("way", ["counter", "message"])
def test_off_ends_with_zero_current_within_two_periods(bench, way):
    bench.at(1.0, "arm")
    bench.at(2.0, "track", reference="sine")
    if way == "counter":
        bench.do(20.0, bench.page.request_off)
    else:
        bench.at(20.0, "off")
    bench.run(until_s=22.0)
    assert currents(bench.between(15.0, 20.0)).min() > 0.1
    assert currents(bench.between(20.11, 22.0)).max() < NONE_A
    assert bench.status["mode"] == "off"


@pytest.fixture
def modes(bench):
    """What has been published of the heater, each once, in its order."""
    seen = []
    bench.clock.follow(lambda _: seen.append(bench.control.published.get("mode")))
    return lambda: [mode for before, mode in pairwise(seen) if mode != before]


@pytest.mark.parametrize("at_s", [1.0, 1.05], ids=["published at once", "published later"])
@pytest.mark.parametrize("way", ["counter", "message"])
def test_off_while_the_heater_is_off_raises_no_alarm(bench, modes, way, at_s):
    if way == "counter":
        bench.do(at_s, bench.page.request_off)
    else:
        bench.at(at_s, "off")
    bench.run(until_s=3.0)
    assert modes() == ["off"]
    assert [event for _, event in bench.status["events"]] == ["OFF", "heater off, confirmed"]


def test_off_that_no_device_confirms_is_told_and_tried_until_one_does(bench, modes):
    bench.do(1.0, lambda: bench.device.faults.vanish(3.0))
    bench.do(1.0, bench.page.request_off)
    bench.run(until_s=8.0)
    assert modes() == ["off", "off, unconfirmed", "off"]
    assert [event for _, event in bench.status["events"]] == ["OFF", "heater off, confirmed"]


def test_an_unrelated_note_on_the_error_that_ended_a_run_raises_no_alarm(bench, modes):
    def fail():
        error = DataError("the log takes no more")
        error.add_note("its folder is gone")
        raise error

    bench.at(1.0, "arm")
    bench.do(2.0, fail)
    bench.run(until_s=4.0)
    assert modes() == ["off", "holding", "off"]
    assert "its folder is gone" in bench.status["fault"]


@pytest.mark.parametrize("acts", [(), ("arm",)], ids=["idle", "heating"])
@pytest.mark.parametrize(("silent_s", "end"), [(0.0, "off"), (600.0, "unconfirmed")])
def test_the_pages_are_told_whether_the_heater_is_confirmed_off_at_the_end(bench, acts, silent_s, end):
    for act in acts:
        bench.at(1.0, act)
    seen = []
    bench.do(2.0, lambda: seen.append(bench.status["end"]))
    bench.do(3.0, lambda: bench.device.faults.vanish(silent_s))
    bench.run(until_s=3.0)
    assert seen == [None]
    assert bench.end == end


def stand_still(bench, *, from_s, to_s):
    """Have the workshop stand still."""
    bench.do(from_s, lambda: setattr(bench.workshop, "stands_still", True))
    bench.do(to_s, lambda: setattr(bench.workshop, "stands_still", False))


def test_an_arm_that_cannot_begin_soon_is_refused_and_does_not_heat_later(bench):
    bench.at(0.5, "arm")
    bench.at(1.0, "track", reference="sine")
    bench.do(19.0, bench.page.request_off)
    stand_still(bench, from_s=19.4, to_s=35.0)
    change = bench.at(19.5, "shape", key="mu_heating", value=90.2)
    arm = bench.at(19.6, "arm")
    bench.run(until_s=40.0)
    assert "still on its way into force: press again" in bench.answers[arm]
    assert bench.answers[change] is None
    assert bench.status["mode"] == "off"
    assert currents(bench.between(19.2, 40.0)).max() < NONE_A


def test_an_arm_waits_a_little_for_a_change_and_begins_with_it(bench):
    stand_still(bench, from_s=0.9, to_s=2.0)
    bench.at(1.0, "shape", key="mu_heating", value=90.2)
    arm = bench.at(1.1, "arm")
    held = []
    bench.do(1.9, lambda: held.append(bench.status["mode"]))
    bench.run(until_s=3.0)
    assert held == ["off"]
    assert bench.answers[arm] is None
    assert bench.status["mode"] == "holding"
    assert bench.status["tuning"]["shape"]["mu_heating"] == pytest.approx(90.2)


def test_off_can_be_followed_by_arming_again(bench):
    bench.at(1.0, "arm")
    bench.at(2.0, "track", reference="sine")
    bench.do(20.0, bench.page.request_off)
    again = bench.at(21.0, "arm")
    bench.run(until_s=23.0)
    assert bench.answers[again] is None
    assert bench.status["mode"] == "holding"


def test_a_change_is_in_force_at_once_and_makes_no_jump(bench):
    bench.at(1.0, "arm")
    bench.at(2.0, "track", reference="sine")
    change = bench.at(30.0, "shape", key="mu_heating", value=92.0)
    bench.run(until_s=32.0)
    assert bench.answers[change] is None
    assert bench.status["tuning"]["shape"]["mu_heating"] == 92.0
    power = np.array([tick.command.power_w for tick in bench.between(29.5, 30.5)])
    assert np.abs(np.diff(power)).max() < 0.1


@pytest.mark.parametrize(
    ("act", "values", "reason"),
    [
        ("shape", {"key": "mu_heating", "value": 60.0}, "must exceed mu_cooling"),
        ("shape", {"key": "mu_heating", "value": 134.9}, "would need"),
        ("shape", {"key": "mu_heating", "value": 140.0}, "temperature_max_c"),
        ("shape", {"key": "scale", "value": 5.0}, "reaches from"),
        ("feedback", {"key": "closed_loop_s", "value": 0.0}, "greater than 0"),
        ("feedback", {"key": "closed_loop_s", "value": 0.04}, "shorter than a period of the loop"),
        ("feedback", {"key": "integral_s", "value": 1e-6}, "shorter than a period of the loop"),
        ("rule", {"index": 0, "direction": 1, "a": -1.0, "b": 0.5}, "no rules"),
        ("track", {"reference": "sine:low_mm=0,high_mm=20,period_s=10"}, "reaches from"),
        ("track", {"reference": "sine:low_mm=2,high_mm=9,period_s=1e-300"}, "the shortest that can be run"),
        (
            "track",
            {"reference": "sine:low_mm=2,high_mm=9,period_s=43200"},
            "lasts 86400 s, the longest that",
        ),
        ("track", {"reference": "steps:low_mm=2,high_mm=9,dwell_s=0.001,cycles=1e5"}, "pieces, at most 2000"),
        ("track", {"reference": "square"}, "neither a shape nor a CSV file"),
        ("undo", {}, "nothing to undo"),
        ("recall", {"slot": "A"}, "slot A is empty"),
        ("compare", {"on": True}, "slot A is empty"),
        ("model", {"text": "{}", "source": "elsewhere"}, "elsewhere"),
    ],
)
def test_what_may_not_be_is_refused_with_its_reason_and_nothing_changes(bench, act, values, reason):
    bench.at(1.0, "arm")
    bench.at(2.0, "track", reference="sine")
    asked = bench.at(15.0, act, **values)
    bench.run(until_s=17.0)
    assert reason in bench.answers[asked]
    assert bench.status["tuning"]["change"] == "as identified"
    assert bench.status["mode"] == "tracking"


def test_a_reference_that_is_too_long_for_the_page_is_not_offered_either():
    day = Reference.from_samples([0.0, 86_400.0], [2.0, 9.0])
    with pytest.raises(ConfigError, match=r"'day.csv' on the tuning page: .*: shorten it.*`smadrive run` takes longer"):
        ReferenceCatalogue({"sine": REFERENCE, "day.csv": day})


def test_what_is_no_request_is_told_and_ignored(bench):
    bench.do(1.0, lambda: bench.page.messages.send(b"\xff no json"))
    bench.at(1.1, "explode")
    bench.at(1.2, "shape", key="mu_heating", value="nan")
    bench.at(1.3, "shape", key="mu_heating", value=90.0, extra=1)
    bench.run(until_s=2.0)
    assert set(bench.answers) == {1, 2, 3}
    assert len([event for _, event in bench.status["events"] if event.startswith("refused")]) == 4
    assert bench.status["tuning"]["change"] == "as identified"


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_value_that_is_no_number_is_refused_by_the_number_of_its_request(bench, value):
    asked = bench.at(1.0, "shape", key="mu_heating", value=value)
    bench.run(until_s=2.0)
    assert "finite number" in bench.answers[asked]


def test_undo_and_redo(bench):
    bench.at(1.0, "arm")
    bench.at(2.0, "shape", key="mu_heating", value=92.0)
    bench.at(3.0, "feedback", key="closed_loop_s", value=0.5)
    bench.at(4.0, "undo")
    bench.at(5.0, "undo")
    seen = []
    for time_s in (3.5, 4.5, 5.5):
        bench.do(time_s, lambda: seen.append(bench.status["tuning"]))
    bench.at(6.0, "redo")
    bench.run(until_s=7.0)
    assert [round(one["shape"]["mu_heating"], 1) for one in seen] == [92.0, 92.0, 89.9]
    assert [one["feedback"]["closed_loop_s"] for one in seen] == [0.5, 0.25, 0.25]
    assert bench.status["undo"] == "mu_heating"
    assert bench.status["redo"] == "closed_loop_s"


def test_a_dragged_slider_is_one_step(bench):
    for n in range(10):
        bench.at(1.0 + 0.1 * n, "shape", key="mu_heating", value=90.0 + 0.1 * n)
    bench.at(2.5, "undo")
    bench.run(until_s=3.0)
    assert bench.status["undo"] is None
    assert bench.status["tuning"]["change"] == "as identified"


def test_a_rule_is_changed_within_what_certifies(ruled_bench):
    good = ruled_bench.at(1.0, "rule", index=7, direction=1, a=-0.2, b=0.19)
    expanding = ruled_bench.at(1.5, "rule", index=7, direction=1, a=0.2, b=0.1)
    unbounded = ruled_bench.at(2.0, "rule", index=7, direction=-1, a=0.2, b=-0.3)
    nowhere = ruled_bench.at(2.5, "rule", index=11, direction=-1, a=0.2, b=-0.1)
    ruled_bench.run(until_s=3.0)
    assert ruled_bench.answers[good] is None
    assert "must contract" in ruled_bench.answers[expanding]
    assert "leaves [0, 1]" in ruled_bench.answers[unbounded]
    assert "11 sets" in ruled_bench.answers[nowhere]
    assert ruled_bench.status["undo"] == "rule 8 heating"


def test_a_and_b_take_turns_and_the_better_one_scores_better(bench):
    bench.at(1.0, "arm")
    bench.at(1.1, "keep", slot="A")
    bench.at(1.2, "feedback", key="closed_loop_s", value=4.0)
    bench.at(1.3, "feedback", key="feedforward_share", value=0.3)
    bench.at(3.0, "keep", slot="B")
    bench.at(3.1, "recall", slot="A")
    bench.at(5.0, "track", reference="sine")
    bench.at(10.0, "compare", on=True)
    meanwhile = bench.at(20.0, "shape", key="mu_heating", value=91.0)
    bench.at(260.0, "compare", on=False)
    bench.run(until_s=262.0)
    comparison = bench.status["comparison"]
    (a_percent, a_cycles), (b_percent, b_cycles) = comparison["scores"]["A"], comparison["scores"]["B"]
    assert "stop the comparison" in bench.answers[meanwhile]
    assert a_cycles >= 2
    assert b_cycles >= 2
    assert a_percent < 0.5 * b_percent
    assert bench.status["tuning"]["feedback"]["closed_loop_s"] == 0.25


def test_a_tuning_is_not_compared_with_itself_whichever_way_it_was_come_by(bench):
    bench.at(1.0, "arm")
    bench.at(1.1, "shape", key="mu_heating", value=90.0)
    bench.at(1.5, "keep", slot="A")
    bench.at(1.6, "shape", key="mu_heating", value=91.0)
    bench.at(2.0, "shape", key="mu_heating", value=90.0)
    bench.at(2.5, "keep", slot="B")
    bench.at(3.0, "track", reference="sine")
    compare = bench.at(5.0, "compare", on=True)
    bench.run(until_s=6.0)
    assert "slot A and slot B keep the same tuning" in bench.answers[compare]
    assert not bench.status["comparison"]["on"]


def half_way_c(wire):
    """Where the heating branch of a wire's file is half way up."""
    model = parse_wire(wire, place="status").model
    return float(np.interp(0.5, model.engine.heating.target, model.engine.nodes))


@pytest.mark.exhaustive
@pytest.mark.xfail(
    reason="a reference of 2 to 9 mm never shows the hot end: the scale is not determined (10.4 to 14.7 instead of "
    "12 mm), and the temperature at half the scale moves with it, though the branch in mm is right within 0.6 K",
    strict=False,
)
def test_the_rules_follow_a_wire_that_changed_and_one_undo_takes_it_back(ruled_bench):
    ruled_bench.at(1.0, "arm")
    ruled_bench.at(1.5, "shape", key="mu_heating", value=92.5)
    ruled_bench.at(4.0, "track", reference="sine")
    ruled_bench.at(20.0, "adapt", on=True)
    seen = []
    ruled_bench.do(290.0, lambda: seen.append(ruled_bench.status))
    ruled_bench.at(291.0, "undo")
    ruled_bench.run(until_s=293.0)
    assert seen[0]["adapts"], seen[0]["events"]
    assert seen[0]["tuning"]["change"] == "adaptation"
    assert abs(half_way_c(seen[0]["tuning"]["wire"]) - 89.9) < 1.0
    assert ruled_bench.status["tuning"]["shape"]["mu_heating"] == pytest.approx(92.5)
    assert not ruled_bench.status["adapts"]


def test_nothing_that_was_asked_before_off_comes_after_it(bench):
    bench.at(1.0, "arm")
    bench.at(2.0, "track", reference="sine")
    bench.do(20.0, bench.page.request_off)
    again = [bench.at(22.0, "arm") for _ in range(6)]
    bench.do(22.0, bench.page.request_off)
    bench.run(until_s=30.0)
    assert bench.status["mode"] == "off"
    assert currents(bench.between(20.5, 30.0)).max() < NONE_A
    assert all("OFF was pressed after this" in bench.answers[arm] for arm in again)


@pytest.mark.parametrize("late_s", [0.0, 1.0])
def test_an_arm_that_does_not_know_of_every_off_is_refused_however_late_it_comes_and_the_next_one_arms(bench, late_s):
    bench.do(1.0, bench.page.request_off)
    bench.do(1.0, bench.page.request_off)
    overtaken = [bench.at(1.0 + late_s, "arm", offs=offs) for offs in (0, 1)]
    bench.run(until_s=4.0)
    assert [bench.answers[arm] for arm in overtaken] == ["OFF was pressed after this: press again"] * 2
    assert not any(tick.measurement.armed for tick in bench.ticks)
    again = bench.at(5.0, "arm")
    bench.run(until_s=6.0)
    assert bench.answers[again] is None
    assert bench.status["mode"] == "holding"


def test_an_arm_that_tells_of_an_off_which_never_arrived_is_refused(bench):
    arm = bench.at(1.0, "arm", offs=1)
    bench.run(until_s=3.0)
    assert "press again" in bench.answers[arm]
    assert not any(tick.measurement.armed for tick in bench.ticks)


def test_an_arm_right_after_off_arms(bench):
    bench.at(1.0, "arm")
    bench.do(2.0, bench.page.request_off)
    bench.run(until_s=3.0)
    bench.do(4.0, bench.page.request_off)
    arm = bench.at(4.0, "arm")
    bench.run(until_s=6.0)
    assert bench.answers[arm] is None
    assert bench.status["mode"] == "holding"


@pytest.mark.parametrize(("act", "values"), [("track", {"reference": "sine"}), ("hold", {}), ("compare", {"on": True})])
def test_nothing_that_drives_the_wire_comes_after_an_off_it_does_not_know_of(bench, act, values):
    bench.do(1.0, bench.page.request_off)
    bench.at(2.0, "arm")
    overtaken = bench.at(3.0, act, offs=0, **values)
    bench.run(until_s=5.0)
    assert bench.answers[overtaken] == "OFF was pressed after this: press again"
    assert bench.status["mode"] == "holding"


def test_every_arm_is_answered_although_off_comes_before_the_wire_holds(bench):
    arms = [bench.at(1.0, "arm"), bench.at(1.0, "arm")]
    off = bench.at(1.0, "off")
    bench.run(until_s=3.0)
    first, second = (bench.answers[arm] for arm in arms)
    assert "switched off meanwhile" in first
    assert "armed already" in second
    assert bench.answers[off] is None
    assert bench.status["mode"] == "off"
    assert currents(bench.ticks).max() < NONE_A


@pytest.mark.parametrize(("first", "mode"), [(("hold", {}), "holding"), (("track", {"reference": "sine"}), "tracking")])
def test_a_slider_that_moves_right_after_it_does_not_take_hold_or_start_back(bench, first, mode):
    bench.at(1.0, "arm")
    if mode == "holding":
        bench.at(2.0, "track", reference="sine")
    bench.at(20.0, first[0], **first[1])
    bench.at(20.0, "shape", key="mu_heating", value=90.2)
    bench.run(until_s=30.0)
    assert bench.status["mode"] == mode
    assert bench.status["tuning"]["shape"]["mu_heating"] == pytest.approx(90.2)


def test_long_texts_do_not_end_it(bench):
    for n in range(8):
        bench.at(1.0 + 0.2 * n, "track", reference="x" * 60000)
    bench.run(until_s=5.0)
    assert len(bench.status["events"]) == 8


def test_a_wire_of_unknown_temperature_is_not_armed(bench):
    bench.do(0.5, bench.device.bench.sensors.faults.open_thermocouple)
    arm = bench.at(1.0, "arm")
    bench.run(until_s=2.0)
    assert "gives no valid reading (thermocouple_open). Check the bead" in bench.answers[arm]


def test_a_model_without_rules_cannot_be_adapted(bench):
    asked = bench.at(1.0, "adapt", on=True)
    bench.run(until_s=2.0)
    assert "no rules" in bench.answers[asked]


def test_a_trip_is_told_with_its_remedy_and_must_be_cleared_by_arming_again(bench):
    bench.at(1.0, "arm")
    bench.at(2.0, "track", reference="sine")
    bench.do(20.0, bench.device.bench.sensors.faults.open_thermocouple)
    bench.run(until_s=22.0)
    assert "fault" in bench.status["fault"]
    assert bench.status["mode"] == "off"
    assert currents(bench.between(21.0, 22.0)).max() < NONE_A
