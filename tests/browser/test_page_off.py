"""Arming and OFF on the tuning page in a real browser."""

import re

import pytest

from smadrive.tuning.session.modes import Mode

from .page_actions import NONE_A, heat, post_off, press


def test_start_tracks_hold_keeps_heating_and_disarm_switches_off(client, live):
    page = client()
    heat(page, live)
    press(page, "Hold")
    live.wait(lambda: live.session.mode is not Mode.TRACKING)
    assert live.session.mode.heats
    press(page, "Disarm")
    live.wait(lambda: live.current_a < NONE_A and not live.session.mode.heats)


@pytest.mark.parametrize("way", ["button", "key", "curl"])
def test_off_switches_the_heater_off(client, live, way):
    page = client()
    heat(page, live)
    if way == "button":
        page.locator("#off").dispatch_event("click")
    elif way == "key":
        page.keyboard.press("Escape")
    else:
        assert post_off(live) == 200
    live.wait(lambda: live.current_a < NONE_A and not live.session.mode.heats)


HOLD_BACK = """() => {
    const send = WebSocket.prototype.send, held = [];
    WebSocket.prototype.send = function (...parts) { held.push(() => send.apply(this, parts)); };
    window.letGo = () => { WebSocket.prototype.send = send; held.forEach(sent => sent()); };
}"""
"""A script that holds back the messages of the page until `letGo()` is called."""


WRONG_COUNT = """arm => {
    const events = Bokeh.documents[0].get_model_by_name('button_events');
    events.setv({offs: events.offs + 7}, {sync: false});
    arm.click();
}"""
"""A script that presses Arm with a wrong count of OFFs. In between, no message of the server can correct the count."""


def arm_button(page):
    return page.locator("button:enabled", has_text=re.compile("^Arm$")).element_handle()


def offs(page):
    """Return the number of OFFs that the page knows."""
    return page.evaluate("() => Bokeh.documents[0].get_model_by_name('button_events').offs")


def is_refused_and_the_next_one_arms(page, live):
    page.locator(".banner", has_text="OFF was pressed after this click. Press again").wait_for()
    assert not live.session.mode.heats
    press(page, "Arm")
    live.wait(lambda: live.session.mode.heats)


def test_off_elsewhere_wins_over_an_earlier_arm_and_the_next_arm_is_accepted(client, live):
    page = client()
    page.evaluate(HOLD_BACK)
    press(page, "Arm")
    before = offs(page)
    assert post_off(live) == 200
    live.wait(lambda: offs(page) == before + 1)
    page.evaluate("() => letGo()")
    is_refused_and_the_next_one_arms(page, live)


def test_page_with_a_wrong_count_of_offs_gets_the_right_one_after_a_refusal(client, live):
    page = client()
    page.evaluate(WRONG_COUNT, arm_button(page))
    is_refused_and_the_next_one_arms(page, live)


def test_arm_right_after_off_on_the_same_page_is_accepted(client, live):
    page = client()
    page.evaluate("arm => { document.getElementById('off').click(); arm.click(); }", arm_button(page))
    live.wait(lambda: live.session.mode.heats)
    assert page.locator(".banner", has_text="OFF was pressed").count() == 0


def test_off_works_on_a_watching_page_without_its_socket(client, live):
    heat(client(), live)
    watcher = client(token=False)
    watcher.evaluate("() => { WebSocket.prototype.send = () => {} }")
    watcher.locator("#off").dispatch_event("click")
    live.wait(lambda: live.current_a < NONE_A and not live.session.mode.heats)


FOREIGN = [
    {"Origin": "http://elsewhere.example"},
    {"Host": "elsewhere.example:80"},
    {"Sec-Fetch-Site": "cross-site"},
]


@pytest.mark.parametrize("headers", FOREIGN)
def test_off_from_another_site_is_refused(client, live, headers):
    heat(client(), live)
    assert post_off(live, **headers) == 403
    assert live.session.mode.heats
