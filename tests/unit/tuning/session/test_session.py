"""The tuning session on the simulated wire: requests of a page, OFF, faults, comparison, adaptation."""

from itertools import pairwise

import numpy as np
import pytest

from firmware_sim.bench import simulated_device
from firmware_sim.config import load_sim
from smadrive.control.references.reference import Reference
from smadrive.errors import ConfigError, DataError
from smadrive.tuning.session.reference_catalogue import ReferenceCatalogue
from smadrive.wire.wire_file import parse_wire
from tests.unit.tuning.conftest import REFERENCE

NONE_A = 0.002
"""The noise of the simulated current measurement."""

AFTER_OFF = "OFF was pressed after this. Press again."


def currents(ticks):
    return np.array([tick.measurement.current_a for tick in ticks])


def error_mm(ticks):
    return np.array([tick.command.setpoint_mm - tick.measurement.displacement_mm for tick in ticks])


def test_idle_session_measures_and_does_not_heat(rig):
    rig.run(until_s=3.0)
    assert len(rig.ticks) == pytest.approx(60, abs=2)
    assert currents(rig.ticks).max() < NONE_A
    assert rig.status["mode"] == "off"
    assert len(rig.page.since(0)[1]) == rig.page.written >= 58


def test_armed_session_follows_a_reference_repeatedly(rig):
    arm, start = rig.at(1.0, "arm"), rig.at(2.0, "track", reference="sine")
    rig.run(until_s=140.0)
    assert rig.answers == {arm: None, start: None}
    assert rig.status["mode"] == "tracking"
    assert np.abs(error_mm(rig.between(60.0, 139.0))).max() < 0.03 * 12.0
    assert np.ptp([tick.command.setpoint_mm for tick in rig.between(100.0, 139.0)]) == pytest.approx(7.0, abs=0.1)


@pytest.mark.parametrize("seed", range(4))
def test_cold_wire_is_armed_without_heat_and_approaches_smoothly(rig, seed):
    rig.device = simulated_device(load_sim("flexinol-lt-0.15mm"), seed)
    rig.clock.follow(rig.device.bench.advance_to)
    rig.at(1.0, "arm")
    rig.at(5.0, "track", reference="sine")
    rig.run(until_s=15.0)
    assert rig.between(2.0, 5.0)[0].measurement.armed
    assert currents(rig.between(0.0, 5.0)).max() < NONE_A
    assert np.abs(error_mm(rig.between(5.0, 15.0))).max() < 0.01 * 12.0


@pytest.mark.parametrize("noise_seed", range(3))
@pytest.mark.parametrize("zero_mm", [-0.6, -0.05, 0.05, 0.6])
def test_cold_wire_is_held_without_heat_although_its_sensor_has_lost_its_zero(rig_without_zero, zero_mm, noise_seed):
    rig = rig_without_zero(zero_mm, noise_seed)
    rig.at(1.0, "arm")
    rig.run(until_s=20.0)
    assert rig.between(2.0, 20.0)[0].measurement.armed
    assert currents(rig.between(0.0, 20.0)).max() < NONE_A


def test_arm_is_refused_when_the_displacement_is_impossible(rig_without_zero):
    rig = rig_without_zero(6.0)
    arm = rig.at(1.0, "arm")
    rig.run(until_s=3.0)
    assert "mm possible at 2" in rig.status["fault"]
    assert rig.answers[arm] == rig.status["fault"]
    assert "armed, holding" not in [event for _, event in rig.status["events"]]
    assert currents(rig.ticks).max() < NONE_A


def test_warm_wire_is_held_at_its_displacement(rig):
    rig.at(1.0, "arm")
    rig.at(2.0, "track", reference="sine")
    rig.do(20.0, rig.page.request_off)
    rig.at(20.3, "arm")
    rig.run(until_s=24.0)
    held = rig.between(21.0, 24.0)
    assert held[0].command.setpoint_mm > 1.0
    assert np.abs(error_mm(held)).max() < 0.03 * 12.0


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
    """The published modes, without repetitions."""
    seen = []
    rig.clock.follow(lambda _: seen.append(rig.control.published.get("mode")))
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


def stop_builder(rig, *, from_s, to_s):
    """Stop the builder for a while."""
    rig.do(from_s, lambda: setattr(rig.builder, "is_stopped", True))
    rig.do(to_s, lambda: setattr(rig.builder, "is_stopped", False))


def test_arm_that_waits_too_long_is_refused_and_does_not_heat_later(rig):
    rig.at(0.5, "arm")
    rig.at(1.0, "track", reference="sine")
    rig.do(19.0, rig.page.request_off)
    stop_builder(rig, from_s=19.4, to_s=35.0)
    change = rig.at(19.5, "shape", key="mu_heating", value=90.2)
    arm = rig.at(19.6, "arm")
    rig.run(until_s=40.0)
    assert "still on its way into force: press again" in rig.answers[arm]
    assert rig.answers[change] is None
    assert rig.status["mode"] == "off"
    assert currents(rig.between(19.2, 40.0)).max() < NONE_A


def test_arm_waits_for_a_change_and_begins_with_it(rig):
    stop_builder(rig, from_s=0.9, to_s=2.0)
    rig.at(1.0, "shape", key="mu_heating", value=90.2)
    arm = rig.at(1.1, "arm")
    held = []
    rig.do(1.9, lambda: held.append(rig.status["mode"]))
    rig.run(until_s=3.0)
    assert held == ["off"]
    assert rig.answers[arm] is None
    assert rig.status["mode"] == "holding"
    assert rig.status["tuning"]["shape"]["mu_heating"] == pytest.approx(90.2)


def test_arm_after_off_is_accepted(rig):
    rig.at(1.0, "arm")
    rig.at(2.0, "track", reference="sine")
    rig.do(20.0, rig.page.request_off)
    again = rig.at(21.0, "arm")
    rig.run(until_s=23.0)
    assert rig.answers[again] is None
    assert rig.status["mode"] == "holding"


def test_change_is_put_in_force_without_a_jump(rig):
    rig.at(1.0, "arm")
    rig.at(2.0, "track", reference="sine")
    change = rig.at(30.0, "shape", key="mu_heating", value=92.0)
    rig.run(until_s=32.0)
    assert rig.answers[change] is None
    assert rig.status["tuning"]["shape"]["mu_heating"] == 92.0
    power = np.array([tick.command.power_w for tick in rig.between(29.5, 30.5)])
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
def test_invalid_request_is_refused_with_its_reason_and_changes_nothing(rig, act, values, reason):
    rig.at(1.0, "arm")
    rig.at(2.0, "track", reference="sine")
    asked = rig.at(15.0, act, **values)
    rig.run(until_s=17.0)
    assert reason in rig.answers[asked]
    assert rig.status["tuning"]["change"] == "as identified"
    assert rig.status["mode"] == "tracking"


def test_catalogue_refuses_a_reference_that_is_too_long_for_the_page():
    day = Reference.from_samples([0.0, 86_400.0], [2.0, 9.0])
    with pytest.raises(ConfigError) as refused:
        ReferenceCatalogue({"sine": REFERENCE, "day.csv": day})
    assert "'day.csv'" in refused.value.where
    assert "smadrive run" in refused.value.cure


def test_malformed_request_is_reported_and_ignored(rig):
    rig.do(1.0, lambda: rig.page.messages.send(b"\xff no json"))
    rig.at(1.1, "explode")
    rig.at(1.2, "shape", key="mu_heating", value="nan")
    rig.at(1.3, "shape", key="mu_heating", value=90.0, extra=1)
    rig.run(until_s=2.0)
    assert set(rig.answers) == {1, 2, 3}
    assert len([event for _, event in rig.status["events"] if event.startswith("refused")]) == 4
    assert rig.status["tuning"]["change"] == "as identified"


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_nonfinite_value_is_refused(rig, value):
    asked = rig.at(1.0, "shape", key="mu_heating", value=value)
    rig.run(until_s=2.0)
    assert "finite number" in rig.answers[asked]


def test_undo_and_redo(rig):
    rig.at(1.0, "arm")
    rig.at(2.0, "shape", key="mu_heating", value=92.0)
    rig.at(3.0, "feedback", key="closed_loop_s", value=0.5)
    rig.at(4.0, "undo")
    rig.at(5.0, "undo")
    seen = []
    for time_s in (3.5, 4.5, 5.5):
        rig.do(time_s, lambda: seen.append(rig.status["tuning"]))
    rig.at(6.0, "redo")
    rig.run(until_s=7.0)
    assert [round(one["shape"]["mu_heating"], 1) for one in seen] == [92.0, 92.0, 89.9]
    assert [one["feedback"]["closed_loop_s"] for one in seen] == [0.5, 0.25, 0.25]
    assert rig.status["undo"] == "mu_heating"
    assert rig.status["redo"] == "closed_loop_s"


def test_dragged_slider_is_one_step_of_the_history(rig):
    for n in range(10):
        rig.at(1.0 + 0.1 * n, "shape", key="mu_heating", value=90.0 + 0.1 * n)
    rig.at(2.5, "undo")
    rig.run(until_s=3.0)
    assert rig.status["undo"] is None
    assert rig.status["tuning"]["change"] == "as identified"


def test_rule_change_outside_the_certificate_is_refused(ruled_rig):
    good = ruled_rig.at(1.0, "rule", index=7, direction=1, a=-0.2, b=0.19)
    expanding = ruled_rig.at(1.5, "rule", index=7, direction=1, a=0.2, b=0.1)
    unbounded = ruled_rig.at(2.0, "rule", index=7, direction=-1, a=0.2, b=-0.3)
    nowhere = ruled_rig.at(2.5, "rule", index=11, direction=-1, a=0.2, b=-0.1)
    ruled_rig.run(until_s=3.0)
    assert ruled_rig.answers[good] is None
    assert "must contract" in ruled_rig.answers[expanding]
    assert "leaves [0, 1]" in ruled_rig.answers[unbounded]
    assert "index" in ruled_rig.answers[nowhere]
    assert ruled_rig.status["undo"] == "rule 8 heating"


def test_comparison_alternates_and_scores_the_better_tuning_better(rig):
    rig.at(1.0, "arm")
    rig.at(1.1, "keep", slot="A")
    rig.at(1.2, "feedback", key="closed_loop_s", value=4.0)
    rig.at(1.3, "feedback", key="feedforward_share", value=0.3)
    rig.at(3.0, "keep", slot="B")
    rig.at(3.1, "recall", slot="A")
    rig.at(5.0, "track", reference="sine")
    rig.at(10.0, "compare", on=True)
    meanwhile = rig.at(20.0, "shape", key="mu_heating", value=91.0)
    rig.at(260.0, "compare", on=False)
    rig.run(until_s=262.0)
    comparison = rig.status["comparison"]
    (a_percent, a_cycles), (b_percent, b_cycles) = comparison["scores"]["A"], comparison["scores"]["B"]
    assert "being compared" in rig.answers[meanwhile]
    assert a_cycles >= 2
    assert b_cycles >= 2
    assert a_percent < 0.5 * b_percent
    assert rig.status["tuning"]["feedback"]["closed_loop_s"] == 0.25


def test_comparison_of_equal_tunings_is_refused(rig):
    rig.at(1.0, "arm")
    rig.at(1.1, "shape", key="mu_heating", value=90.0)
    rig.at(1.5, "keep", slot="A")
    rig.at(1.6, "shape", key="mu_heating", value=91.0)
    rig.at(2.0, "shape", key="mu_heating", value=90.0)
    rig.at(2.5, "keep", slot="B")
    rig.at(3.0, "track", reference="sine")
    compare = rig.at(5.0, "compare", on=True)
    rig.run(until_s=6.0)
    assert "slot A and slot B keep the same tuning" in rig.answers[compare]
    assert not rig.status["comparison"]["on"]


def half_way_c(wire):
    """The temperature at which the heating branch of a wire file is half way up."""
    model, _ = parse_wire(wire, place="status")
    return float(np.interp(0.5, model.engine.heating.target, model.engine.nodes))


@pytest.mark.xfail(
    reason="the branch ends 0.9 to 1.7 K from the truth, by where the ticks lie between the conversions", strict=False
)
def test_adaptation_follows_a_changed_wire_and_one_undo_takes_it_back(ruled_rig):
    ruled_rig.at(1.0, "arm")
    ruled_rig.at(1.5, "shape", key="mu_heating", value=92.5)
    ruled_rig.at(4.0, "track", reference="sine")
    ruled_rig.at(20.0, "adapt", on=True)
    seen = []
    ruled_rig.do(290.0, lambda: seen.append(ruled_rig.status))
    ruled_rig.at(291.0, "undo")
    ruled_rig.run(until_s=293.0)
    assert seen[0]["adapts"], seen[0]["events"]
    assert seen[0]["tuning"]["change"] == "adaptation"
    assert abs(half_way_c(seen[0]["tuning"]["wire"]) - 89.9) < 1.0
    assert ruled_rig.status["tuning"]["shape"]["mu_heating"] == pytest.approx(92.5)
    assert not ruled_rig.status["adapts"]


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
    assert "switched off meanwhile" in first
    assert "armed already" in second
    assert rig.answers[off] is None
    assert rig.status["mode"] == "off"
    assert currents(rig.ticks).max() < NONE_A


@pytest.mark.parametrize(("first", "mode"), [(("hold", {}), "holding"), (("track", {"reference": "sine"}), "tracking")])
def test_slider_moved_after_hold_or_start_does_not_undo_it(rig, first, mode):
    rig.at(1.0, "arm")
    if mode == "holding":
        rig.at(2.0, "track", reference="sine")
    rig.at(20.0, first[0], **first[1])
    rig.at(20.0, "shape", key="mu_heating", value=90.2)
    rig.run(until_s=30.0)
    assert rig.status["mode"] == mode
    assert rig.status["tuning"]["shape"]["mu_heating"] == pytest.approx(90.2)


def test_long_texts_do_not_end_the_session(rig):
    for n in range(8):
        rig.at(1.0 + 0.2 * n, "track", reference="x" * 60000)
    rig.run(until_s=5.0)
    assert len(rig.status["events"]) == 8


def test_arm_is_refused_when_the_temperature_is_unknown(rig):
    rig.do(0.5, rig.device.bench.sensors.faults.open_thermocouple)
    arm = rig.at(1.0, "arm")
    rig.run(until_s=2.0)
    assert "gives no valid reading (thermocouple_open): check the bead" in rig.answers[arm]


def test_adaptation_of_a_model_without_rules_is_refused(rig):
    asked = rig.at(1.0, "adapt", on=True)
    rig.run(until_s=2.0)
    assert "no rules" in rig.answers[asked]


def test_trip_is_published_and_ends_at_zero_current(rig):
    rig.at(1.0, "arm")
    rig.at(2.0, "track", reference="sine")
    rig.do(20.0, rig.device.bench.sensors.faults.open_thermocouple)
    rig.run(until_s=22.0)
    assert "fault" in rig.status["fault"]
    assert rig.status["mode"] == "off"
    assert currents(rig.between(21.0, 22.0)).max() < NONE_A
