"""Changes of the tuning are put in force, refused, undone and compared."""

import numpy as np
import pytest
from marks import exhaustive

from smadrive.control.references.reference import Reference
from smadrive.errors import ConfigError
from smadrive.hysteresis.model_file import model_text
from smadrive.rig.config import FeedbackConfig
from smadrive.tuning.session.reference_catalogue import ReferenceCatalogue
from smadrive.tuning.tuning import Tuning
from smadrive.wire.identified_wire import parse_wire
from tests.unit.tuning.conftest import REFERENCE, error_mm


def test_change_is_put_in_force_without_a_jump(rig):
    rig.at(1.0, "arm")
    rig.at(2.0, "track", reference="sine")
    change = rig.at(30.0, "shape", key="mu_heating", value=92.0)
    rig.run(until_s=32.0)
    assert rig.answers[change] is None
    assert rig.status["tuning"]["shape"]["mu_heating"] == 92.0
    power = np.array([tick.command.power_w for tick in rig.between(29.5, 30.5)])
    assert np.abs(np.diff(power)).max() < 0.1


INVALID = [
    ("shape", {"key": "mu_heating", "value": 60.0}, "must exceed mu_cooling"),
    ("shape", {"key": "mu_heating", "value": 134.9}, "above temperature_max_c"),
    ("shape", {"key": "mu_heating", "value": 140.0}, "temperature_max_c"),
    ("shape", {"key": "scale", "value": 5.0}, "reference: highest value: "),
    ("feedback", {"key": "closed_loop_s", "value": 0.0}, "greater than 0"),
    ("feedback", {"key": "closed_loop_s", "value": 0.04}, "shorter than a period of the loop"),
    ("feedback", {"key": "integral_s", "value": 1e-6}, "shorter than a period of the loop"),
    ("rule", {"index": 0, "direction": 1, "a": -1.0, "b": 0.5}, "no rules"),
    ("track", {"reference": "sine:low_mm=0,high_mm=20,period_s=10"}, "reference: highest value: "),
    ("track", {"reference": "sine:low_mm=2,high_mm=9,period_s=1e-300"}, "(2e-300 s, limit 0.1 s)"),
    ("track", {"reference": "sine:low_mm=2,high_mm=9,period_s=43200"}, "(86400 s, limit "),
    ("track", {"reference": "steps:low_mm=2,high_mm=9,dwell_s=0.001,cycles=1e5"}, "limit 2000"),
    ("track", {"reference": "square"}, "neither a shape nor a CSV file"),
    ("undo", {}, "no change to undo"),
    ("recall", {"slot": "A"}, "slot A is empty"),
    ("compare", {"on": True}, "slot A is empty"),
    ("model", {"text": "{}", "source": "elsewhere"}, "elsewhere"),
]
"""Requests of the page, and a part of the reason why each is refused."""


def test_invalid_request_is_refused_with_its_reason_and_changes_nothing(rig):
    rig.at(1.0, "arm")
    rig.at(2.0, "track", reference="sine")
    asked, states = {}, []
    for number, (act, values, _) in enumerate(INVALID):
        asked[rig.at(15.0 + number, act, **values)] = INVALID[number]
        rig.do(15.9 + number, lambda: states.append((rig.status["tuning"]["change"], rig.status["mode"])))
    rig.run(until_s=16.0 + len(INVALID))
    wrong = {number: case for number, case in asked.items() if case[2] not in (rig.answers[number] or "")}
    assert not wrong, {number: rig.answers[number] for number in wrong}
    assert states == [("as identified", "tracking")] * len(INVALID)


def test_catalogue_refuses_a_reference_that_is_too_long_for_the_page():
    day = Reference.from_samples([0.0, 86_400.0], [2.0, 9.0])
    with pytest.raises(ConfigError) as refused:
        ReferenceCatalogue({"sine": REFERENCE, "day.csv": day})
    assert "'day.csv'" in refused.value.where
    assert "smadrive run" in refused.value.cure


def test_undo_takes_a_change_back_and_redo_can_make_it_again(rig):
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


def test_newer_value_of_a_slider_is_not_put_before_an_undo(rig):
    rig.do(1.0, lambda: setattr(rig.builder, "is_stopped", True))
    rig.at(1.1, "feedback", key="closed_loop_s", value=0.5)
    rig.at(1.2, "shape", key="mu_heating", value=90.5)
    rig.at(1.3, "undo")
    rig.at(1.4, "shape", key="mu_heating", value=91.0)
    rig.do(2.0, lambda: setattr(rig.builder, "is_stopped", False))
    rig.run(until_s=3.0)
    assert rig.status["tuning"]["shape"]["mu_heating"] == pytest.approx(91.0)


def test_undo_and_redo_report_the_change_that_was_built_after_the_request(rig):
    rig.do(1.0, lambda: setattr(rig.builder, "is_stopped", True))
    rig.at(1.1, "feedback", key="closed_loop_s", value=0.5)
    rig.at(1.2, "shape", key="mu_heating", value=90.5)
    rig.at(1.3, "undo")
    rig.at(1.4, "redo")
    rig.do(2.0, lambda: setattr(rig.builder, "is_stopped", False))
    rig.run(until_s=3.0)
    assert [event for _, event in rig.status["events"]][-2:] == ["undo: mu_heating", "redo: mu_heating"]


def test_rule_change_outside_the_certificate_is_refused(ruled_rig):
    good = ruled_rig.at(1.0, "rule", index=7, direction=1, a=-0.2, b=0.19)
    expanding = ruled_rig.at(1.5, "rule", index=7, direction=1, a=0.2, b=0.1)
    unbounded = ruled_rig.at(2.0, "rule", index=7, direction=-1, a=0.2, b=-0.3)
    nowhere = ruled_rig.at(2.5, "rule", index=11, direction=-1, a=0.2, b=-0.1)
    ruled_rig.run(until_s=3.0)
    assert ruled_rig.answers[good] is None
    assert "not stable" in ruled_rig.answers[expanding]
    assert "leaves [0, 1]" in ruled_rig.answers[unbounded]
    assert "index" in ruled_rig.answers[nowhere]
    assert ruled_rig.status["undo"] == "rule 8 heating"


@pytest.mark.exhaustive
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
    assert "slot A and slot B hold the same tuning" in rig.answers[compare]
    assert not rig.status["comparison"]["on"]


QUICK = "sine:low_mm=4,high_mm=6,period_s=8,cycles=1"


def compare_two_strokes(rig, first):
    """Compare a tuning with a stroke of 12 mm (A) with one of 11 mm (B), on a quick reference that replaces `first`."""
    rig.at(1.0, "arm")
    rig.at(1.1, "keep", slot="A")
    rig.at(1.2, "shape", key="scale", value=11.0)
    rig.at(1.6, "keep", slot="B")
    rig.at(1.7, "undo")
    rig.at(2.0, "track", reference=first)
    if first != QUICK:
        rig.at(3.0, "track", reference=QUICK)
    rig.at(3.0, "compare", on=True)


@pytest.mark.exhaustive
def test_scores_of_a_comparison_are_in_percent_of_one_stroke(rig):
    compare_two_strokes(rig, QUICK)
    rig.run(until_s=37.0)
    turns = [(time_s, event) for time_s, event in rig.status["events"] if event.endswith("drives")]
    began_s, _ = next(turn for turn in turns if turn[1].endswith("B drives"))
    ended_s = next(time_s for time_s, event in turns if time_s > began_s)
    rms_mm = np.sqrt(np.mean(np.square(error_mm(rig.between(began_s - 0.01, ended_s - 0.01)))))
    assert rig.status["comparison"]["scores"]["B"][0] == pytest.approx(100.0 * rms_mm / 12.0, rel=0.02)


@pytest.mark.exhaustive
def test_turn_of_a_comparison_tracks_a_reference_that_began_just_before(rig):
    compare_two_strokes(rig, "sine")
    rig.run(until_s=24.0)
    assert rig.status["comparison"]["turn"] == "A"
    setpoints_mm = [tick.command.setpoint_mm for tick in rig.between(22.0, 24.0)]
    assert 4.0 <= min(setpoints_mm) < max(setpoints_mm) <= 6.0


def half_way_c(wire):
    """Return the temperature at which the heating branch of a wire file is half way up."""
    model = parse_wire(wire, place="status").model
    return float(np.interp(0.5, model.engine.heating.target, model.engine.nodes))


@pytest.mark.exhaustive
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


@pytest.mark.parametrize(
    ("first", "mode"), [exhaustive(("hold", {}), "holding"), (("track", {"reference": "sine"}), "tracking")]
)
def test_slider_moved_after_hold_or_start_does_not_undo_it(rig, first, mode):
    rig.at(1.0, "arm")
    if mode == "holding":
        rig.at(2.0, "track", reference="sine")
    rig.at(20.0, first[0], **first[1])
    rig.at(20.0, "shape", key="mu_heating", value=90.2)
    rig.run(until_s=30.0)
    assert rig.status["mode"] == mode
    assert rig.status["tuning"]["shape"]["mu_heating"] == pytest.approx(90.2)


def test_model_without_rules_ends_the_adaptation_and_not_the_session(ruled_rig, true_model):
    ruled_rig.at(1.0, "arm")
    ruled_rig.at(2.0, "adapt", on=True)
    text = model_text(true_model, {}, place="duhem.json")
    ruled_rig.at(3.0, "model", text=text, source="duhem.json")
    ruled_rig.run(until_s=5.0)
    assert ruled_rig.status["mode"] == "holding"
    assert not ruled_rig.status["adapts"]
    assert any("no rules" in event for _, event in ruled_rig.status["events"])


def test_session_with_a_model_without_rules_is_armed_even_if_the_rig_file_asks_to_adapt(rig):
    rig.tuning = lambda _config: Tuning.of(rig.model, FeedbackConfig(adapt=True), "as identified")
    rig.at(1.0, "arm")
    rig.run(until_s=2.0)
    assert (rig.status["mode"], rig.status["adapts"]) == ("holding", False)


def test_adaptation_of_a_model_without_rules_is_refused(rig):
    asked = rig.at(1.0, "adapt", on=True)
    rig.run(until_s=2.0)
    assert "no rules" in rig.answers[asked]
