"""Changes, saving and fits on the tuning page in a real browser."""

import pytest

from smadrive.hysteresis import load_model
from smadrive.measurement import DisplacementFrom
from smadrive.rig.config import load_rig

from .page_actions import cells, choose, field, heat, name, opened_editor, press, turn


def test_knob_changes_the_model_in_the_loop_and_undo_restores_it(client, live):
    page = client()
    turn(page, "μ heating", 90.5)
    live.wait(lambda: live.in_force.shape.mu_heating == 90.5)
    changed_s = live.time_s
    live.wait(lambda: live.time_s > changed_s + 1.6)  # longer than a drag: the next change is another step
    before = live.in_force.shape.mu_heating
    turn(page, "μ heating", 91.0)
    live.wait(lambda: live.in_force.shape.mu_heating == 91.0)
    press(page, "Undo mu_heating")
    live.wait(lambda: live.in_force.shape.mu_heating == before)
    live.wait(lambda: abs(float(field(page, "μ heating").input_value()) - before) < 0.001)
    press(page, "Redo mu_heating")
    live.wait(lambda: live.in_force.shape.mu_heating == 91.0)


def test_chosen_source_drives_the_wire_and_undo_takes_it_back(client, live):
    page = client()
    before = live.in_force.displacement_from
    heat(page, live)
    choose(page, "resistance")
    live.wait(lambda: live.in_force.displacement_from is DisplacementFrom.RESISTANCE)
    live.wait(lambda: live.ticks[-1][1].command.uses_resistance)
    press(page, "Undo displacement_from")
    live.wait(lambda: live.in_force.displacement_from is before)
    page.locator(".bk-btn.bk-active", has_text=before.value).wait_for()


def test_slider_can_be_moved_by_its_keys(client, live):
    page = client()
    before = live.in_force.feedback.feedforward_share
    handle = page.locator(".bk-Row", has=page.get_by_text("feedforward share")).locator(".noUi-handle")
    handle.focus()
    for _ in range(10):
        handle.press("ArrowLeft")
    live.wait(lambda: live.in_force.feedback.feedforward_share < before - 0.02)


def test_refused_value_shows_its_reason_and_the_value_in_force_again(client, live):
    page = client()
    before = live.in_force
    turn(page, "μ heating", 60.0)
    page.get_by_text("must exceed mu_cooling").first.wait_for()
    assert live.in_force is before
    live.wait(lambda: abs(float(field(page, "μ heating").input_value()) - live.in_force.shape.mu_heating) < 0.001)


def test_rule_edited_in_the_table_is_put_in_force(client, live):
    page = client()
    editor = opened_editor(page, page.locator(".slick-row").nth(2).locator(".slick-cell").nth(1))
    editor.fill("-0.05")
    editor.press("Enter")
    live.wait(lambda: live.in_force.change == "rule 3 heating")
    assert live.in_force.model.heating_law[0][2] == -0.05


def test_table_shows_the_rules_in_force(client, live):
    page = client()
    turn(page, "μ heating", 99.0)
    live.wait(lambda: live.in_force.shape.mu_heating == 99.0)
    centres, a = live.in_force.model.sets.centres[:4], live.in_force.model.cooling_law[0][:4]
    live.wait(lambda: cells(page, 0) == pytest.approx(list(centres), abs=0.051))
    live.wait(lambda: cells(page, 3) == pytest.approx(list(a), abs=0.000051))


def test_table_shows_the_rule_in_force_after_a_refusal(client, live):
    page = client()
    before = live.in_force
    editor = opened_editor(page, page.locator(".slick-row").nth(2).locator(".slick-cell").nth(1))
    editor.fill("5")
    editor.press("Enter")
    page.get_by_text("rule: ").first.wait_for()
    assert live.in_force is before
    live.wait(lambda: cells(page, 1)[2] == pytest.approx(before.model.heating_law[0][2], abs=0.000051))


def test_saved_files_load_and_no_file_is_overwritten(client, live):
    page = client()
    turn(page, "closed loop", 0.4)
    live.wait(lambda: live.in_force.feedback.closed_loop_s == 0.4)
    name(page, "wire-2")
    page.get_by_text("closed_loop_s").first.wait_for()
    press(page, "Save")
    page.get_by_text("saved:").wait_for()
    rig = load_rig(str(live.folder / "wire-2.toml"))
    assert rig.feedback.closed_loop_s == 0.4
    assert load_model(rig.model).rules == live.in_force.model.rules
    press(page, "Save")
    page.get_by_text("choose another name").wait_for()
    name(page, "../elsewhere")
    press(page, "Save")
    page.get_by_text("invalid file name").wait_for()


def test_failed_fit_is_shown(client, live):
    page = client()
    idle_s = live.time_s
    live.wait(lambda: live.time_s > idle_s + 10.0)
    fit_s = page.locator(".card", has_text="Fit to the last seconds").locator("input.bk-input").first
    fit_s.fill("10")
    fit_s.press("Enter")
    press(page, "Fit")
    page.locator(".banner", has_text="no displacement was measured").wait_for()
    page.locator(".card", has_text="Events").get_by_text(
        "not fitted: the last 10 s: no displacement was measured"
    ).first.wait_for()
