"""The texts of the tuning page."""

import pytest

from smadrive.tuning.page.panel import SENSOR_REPLACED, banner_html, chips_html, scores_html, watch_banner_html


@pytest.mark.parametrize(("scored", "text"), [(0, "not scored"), (1, "RMS, 1 turn<"), (2, "RMS, 2 turns<")])
def test_turns_of_a_comparison_are_counted(scored, text):
    mean_percent = 1.5 if scored else None
    comparison = {"scores": {slot: [mean_percent, scored] for slot in "AB"}, "slots": {}, "turn": None}
    assert scores_html(comparison).count(text) == 2


@pytest.mark.parametrize(
    ("chosen", "in_force", "text", "is_replaced"),
    [
        ("sensor", None, None, False),
        ("sensor", "sensor", 'calm"><i>displacement from</i><b>sensor<', False),
        ("sensor", "resistance", 'warn"><i>displacement from</i><b>resistance, not sensor<', True),
        ("sensor", "none", 'warn"><i>displacement from</i><b>none, not sensor<', False),
        ("resistance", "none", 'calm"><i>displacement from</i><b>none, not resistance<', False),
        ("resistance", "resistance", 'calm"><i>displacement from</i><b>resistance<', False),
    ],
)
def test_source_in_force_is_named_and_a_failed_sensor_warned_of(rig, chosen, in_force, text, is_replaced):
    rig.run(until_s=0.2)
    tuning = {**rig.status["tuning"], "displacement_from": chosen}
    status = {**rig.status, "tuning": tuning, "displacement_in_force": in_force}
    chips = chips_html(status, "", late=False, controls=True)
    assert text in chips if text else "displacement from" not in chips
    assert (SENSOR_REPLACED in banner_html(status, "")) is is_replaced


@pytest.mark.parametrize(
    ("mode", "chip", "is_alarm"),
    [
        ("off", 'off"><i>heater</i><b>off<', False),
        ("holding", 'on"><i>heater</i><b>holding<', False),
        ("tracking", 'on"><i>heater</i><b>tracking<', False),
        ("off, unconfirmed", 'bad"><i>heater</i><b>off, unconfirmed<', True),
    ],
)
def test_heater_that_is_not_confirmed_off_raises_an_alarm(rig, mode, chip, is_alarm):
    rig.run(until_s=0.2)
    status = {**rig.status, "mode": mode}
    assert chip in chips_html(status, "", late=False, controls=True)
    assert ("The heater could NOT be confirmed off: cut its supply." in banner_html(status, "")) is is_alarm


def test_current_that_flows_although_the_heater_is_off_raises_an_alarm(rig):
    rig.do(0.2, lambda: rig.device.bench.plant.faults.short_switch(0.3))
    rig.run(until_s=1.0)
    warning = rig.status["unexpected_current"]
    assert rig.status["mode"] == "off"
    assert 'bad"><i>heater<' in chips_html(rig.status, "", late=False, controls=True)
    assert warning in banner_html(rig.status, "")


def test_reading_that_is_missing_raises_an_alarm(rig):
    rig.do(0.2, rig.device.bench.sensors.faults.lose_current)
    rig.run(until_s=1.0)
    reason = rig.status["supply_fault"]
    assert reason in banner_html(rig.status, "")
    assert reason in watch_banner_html(rig.status)
