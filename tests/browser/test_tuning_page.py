"""The tuning page in a real browser: plots, widgets, requests, and OFF while other processes are stopped or killed."""

import http.client
import http.server
import math
import os
import re
import signal
import threading
import time
import urllib.parse

import pytest

from smadrive.hysteresis import load_model
from smadrive.rig.config import load_rig
from smadrive.tuning.session.modes import Mode

from .conftest import PATIENCE_S, Session

NONE_A = 0.002

pytestmark = pytest.mark.timeout(400)


def press(page, name):
    """Click a button as soon as it is enabled, without waiting until its position is stable."""
    page.locator("button:enabled", has_text=re.compile(f"^{name}$")).dispatch_event("click")


def field(page, name):
    """The field of a knob, by the title of its slider."""
    row = page.locator(".bk-Row", has=page.get_by_text(name))
    return row.locator("input.bk-input").last


def turn(page, name, value):
    field(page, name).fill(str(value))
    field(page, name).press("Enter")


def name(page, text):
    page.get_by_placeholder("name of the new files").fill(text)
    page.get_by_placeholder("name of the new files").press("Tab")


def opened_editor(page, cell):
    """The field in which a table's cell is edited: tried again until the table takes the double click."""
    editor = page.locator(".slick-cell input")
    while not editor.is_visible():
        cell.dblclick(force=True)
        page.wait_for_timeout(500)
    return editor


def heat(page, live):
    press(page, "Arm")
    live.wait(lambda: live.session.mode.heats)
    press(page, "Start")
    live.wait(lambda: live.session.mode is Mode.TRACKING and live.current_a > 0.1)


def drawn(page, *columns):
    """Columns of the plots' data, as the browser has them at one moment."""
    script = """columns => { for (const model of Bokeh.documents[0]._all_models.values())
        if (model.type === "ColumnDataSource" && columns.every(column => model.data[column]))
            return columns.map(column => Array.from(model.data[column])) }"""
    return page.evaluate(script, columns)


def newest(page, column):
    return drawn(page, column)[0][-1]


def errors(page):
    """Each error that is drawn, by its time."""
    pairs = zip(*drawn(page, "time_s", "error_percent"), strict=True)
    return {time_s: percent for time_s, percent in pairs if math.isfinite(percent)}


def test_page_loads_nothing_from_elsewhere_and_its_plots_move(client, live):
    page = client()
    assert page.requests
    assert not [url for url in page.requests if not url.startswith(live.page.url.split("?")[0])]
    first = newest(page, "time_s")
    live.wait(lambda: newest(page, "time_s") > first + 1.0)


@pytest.mark.parametrize("width", [390, 700, 1000, 1280, 1600])
def test_nothing_is_cut_off_at_any_window_width(client, width):
    page = client()
    page.set_viewport_size({"width": width, "height": 800})
    beyond = """() => [...document.querySelectorAll("header > *, .card")].filter(
        element => element.getBoundingClientRect().right > innerWidth).length"""
    assert page.evaluate(beyond) == 0
    for card in page.locator(".card").all():
        card.scroll_into_view_if_needed()
        assert card.bounding_box()["height"] > 80
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    page.get_by_text("Events", exact=True).scroll_into_view_if_needed()
    assert page.locator("#off").bounding_box()["y"] < 40


OVERLAPS = """() => {
    const places = [...document.querySelectorAll("header > *, .card")].map(
        element => [element, element.getBoundingClientRect()]);
    const overlap = (a, b) => Math.min(a.right, b.right) > Math.max(a.left, b.left) + 1
        && Math.min(a.bottom, b.bottom) > Math.max(a.top, b.top) + 1;
    return places.flatMap(([element, place], n) => places.slice(n + 1).filter(([other, there]) =>
        element.parentNode.tagName === other.parentNode.tagName
        && overlap(place, there)).map(([other]) => [element.innerText, other.innerText])) }"""
"""Which parts of the head, and which cards, lie over each other."""

OVER_OFF = """() => {
    const off = document.getElementById("off"), place = off.getBoundingClientRect();
    const shares = [0.05, 0.5, 0.95];
    return shares.flatMap(x => shares.map(y => document.elementFromPoint(
        place.left + x * place.width, place.top + y * place.height))).filter(top => !off.contains(top)).length }"""
"""At how many of nine points something lies over OFF."""


@pytest.mark.parametrize("width", [390, 700, 720, 1000, 1280, 1600])
def test_nothing_overlaps_at_any_window_width(client, width):
    page = client()
    page.set_viewport_size({"width": width, "height": 800})
    assert page.evaluate(OVERLAPS) == []
    assert page.evaluate(OVER_OFF) == 0


def test_page_that_watched_before_shows_active_widgets_in_the_accent_colour(client, live):
    first, page = client(), client(says="watches")
    first.close()
    arm = page.get_by_role("button", name="Arm", exact=True)
    live.wait(arm.is_enabled)
    colour = "element => getComputedStyle(element).backgroundColor"
    for element in (page.locator(".noUi-connect").first, arm):
        live.wait(lambda element=element: element.evaluate(colour) == "rgb(11, 143, 135)")


def test_arm_start_hold_and_disarm(client, live):
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


def post_off(live, **headers):
    """POST /off as curl would; the status of the reply."""
    connection = http.client.HTTPConnection("127.0.0.1", urllib.parse.urlsplit(live.page.url).port, timeout=10.0)
    connection.request("POST", "/off", headers=headers)
    status = connection.getresponse().status
    connection.close()
    return status


HOLD_BACK = """() => {
    const send = WebSocket.prototype.send, held = [];
    WebSocket.prototype.send = function (...parts) { held.push(() => send.apply(this, parts)); };
    window.letGo = () => { WebSocket.prototype.send = send; held.forEach(sent => sent()); };
}"""
"""Holds back the messages of the page until `letGo()`."""


def offs(page):
    """How many OFFs the page knows of."""
    return page.evaluate("() => Bokeh.documents[0].get_model_by_name('button_events').offs")


def is_refused_and_the_next_one_arms(page, live):
    page.locator(".banner", has_text="OFF was pressed after this. Press again").wait_for()
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
    page.evaluate("() => Bokeh.documents[0].get_model_by_name('button_events').setv({offs: 7}, {sync: false})")
    press(page, "Arm")
    is_refused_and_the_next_one_arms(page, live)


def test_arm_right_after_off_on_the_same_page_is_accepted(client, live):
    page = client()
    arm = page.locator("button:enabled", has_text=re.compile("^Arm$")).element_handle()
    page.evaluate("arm => { document.getElementById('off').click(); arm.click(); }", arm)
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


def test_knob_changes_the_model_in_the_loop_and_undo_restores_it(client, live):
    page = client()
    turn(page, "μ heating", 90.5)
    live.wait(lambda: live.in_force.shape.mu_heating == 90.5)
    time.sleep(1.6)  # longer than a drag: another change of the same thing is another step
    before = live.in_force.shape.mu_heating
    turn(page, "μ heating", 91.0)
    live.wait(lambda: live.in_force.shape.mu_heating == 91.0)
    press(page, "Undo mu_heating")
    live.wait(lambda: live.in_force.shape.mu_heating == before)
    live.wait(lambda: abs(float(field(page, "μ heating").input_value()) - before) < 0.001)
    press(page, "Redo mu_heating")
    live.wait(lambda: live.in_force.shape.mu_heating == 91.0)


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


def cells(page, column):
    """The figures that a column of the table of rules shows in its first rows."""
    return [float(text) for text in page.locator(f".slick-cell.l{column}").all_inner_texts()[:4]]


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


def test_page_opened_later_draws_the_same_errors(client, live):
    page = client()
    heat(page, live)
    live.wait(lambda: len(errors(page)) > 20)
    late, early = errors(client(token=False)), errors(page)
    both = late.keys() & early.keys()
    assert len(both) > 20
    assert {time_s: late[time_s] for time_s in both} == pytest.approx({time_s: early[time_s] for time_s in both})


def test_second_client_watches_until_the_first_leaves(client, live):
    before = live.in_force
    first, second, outsider = client(), client(says="watches"), client(token=False)
    for watcher in (second, outsider):
        assert watcher.get_by_role("button", name="Arm", exact=True).is_disabled()
        assert field(watcher, "μ heating").is_disabled()
    second.evaluate(
        """() => { for (const model of Bokeh.documents[0]._all_models.values())
            if (model.type === "Spinner" && model.format === "0.[000]") { model.value = 95; break } }"""
    )
    second.get_by_text("this page only watches").wait_for()
    assert live.in_force is before
    first.close()
    live.wait(lambda: second.get_by_role("button", name="Arm", exact=True).is_enabled())
    assert outsider.get_by_role("button", name="Arm", exact=True).is_disabled()


def test_control_process_knows_how_many_pages_are_open(client, live):
    live.wait(lambda: live.channel.pages == (0, False))
    page = client()
    client(token=False)
    live.wait(lambda: live.channel.pages == (2, True))
    page.close()
    live.wait(lambda: live.channel.pages == (1, False))


def test_killed_page_process_is_restarted_while_the_loop_continues(client, live):
    page = client()
    heat(page, live)
    killed_s, restarts = time.monotonic(), live.page.server.restarts
    page.evaluate("() => { window.isOld = true }")
    os.kill(live.page.server.pid, signal.SIGKILL)
    live.wait(lambda: live.page.server.restarts > restarts)
    page.wait_for_function("() => !window.isOld")
    page.get_by_text("tracking").first.wait_for()
    assert live.session.mode is Mode.TRACKING
    assert len([stamp for stamp, _ in live.ticks if stamp > killed_s]) > 10
    page.locator("#off").dispatch_event("click")
    live.wait(lambda: not live.session.mode.heats)


def test_page_requested_during_a_restart_loads_when_the_process_answers(browser, live):
    context = browser.new_context()
    for _ in range(2):
        restarts = live.page.server.restarts
        os.kill(live.page.server.pid, signal.SIGKILL)
        page = context.new_page()
        assert page.goto(live.page.url).status == http.client.SERVICE_UNAVAILABLE
        page.get_by_text("controls", exact=True).wait_for(timeout=1000 * PATIENCE_S)
        assert live.page.server.restarts > restarts
        page.close()
    context.close()


def test_frozen_page_process_delays_neither_the_loop_nor_off(client, live):
    page = client()
    heat(page, live)
    os.kill(live.page.server.pid, signal.SIGSTOP)
    try:
        page.get_by_text("The page has lost its server").wait_for()
        ticks = len(live.ticks)
        live.wait(lambda: len(live.ticks) > ticks + 40)
        assert live.session.mode is Mode.TRACKING
        page.locator("#off").dispatch_event("click")
        live.wait(lambda: live.current_a < NONE_A and not live.session.mode.heats)
    finally:
        os.kill(live.page.server.pid, signal.SIGCONT)
    page.get_by_text("The page has lost its server").wait_for(state="hidden")


def test_killed_front_process_is_restarted_and_the_page_shows_the_loss(client, live):
    page = client()
    page.evaluate("() => { window.isOld = true }")
    os.kill(live.page.front.pid, signal.SIGKILL)
    page.get_by_text("No connection to smadrive tune").wait_for()
    page.wait_for_function("() => !window.isOld")
    page.get_by_text("controls", exact=True).wait_for()
    heat(page, live)
    page.locator("#off").dispatch_event("click")
    live.wait(lambda: not live.session.mode.heats)


class Elsewhere(http.server.BaseHTTPRequestHandler):
    """A web server with one page."""

    def do_GET(self):
        self.send_response(http.client.OK)
        self.end_headers()
        self.wfile.write(b"<p>elsewhere</p>")

    def log_message(self, *args):
        """Log nothing."""


@pytest.fixture
def elsewhere():
    """The address of another server on this machine."""
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), Elsewhere) as server:
        serving = threading.Thread(target=server.serve_forever)
        serving.start()
        yield f"http://127.0.0.1:{server.server_port}/"
        server.shutdown()
        serving.join()


def test_page_of_another_server_can_neither_switch_off_nor_load_pages(browser, live, elsewhere):
    live.wait(lambda: live.channel.pages == (0, False))
    offs, url = live.channel.offs, live.page.url.split("?")[0]
    with browser.new_context() as context:
        page = context.new_page()
        page.goto(elsewhere)
        with page.expect_event("requestfailed"):
            page.evaluate("url => { document.body.append(Object.assign(new Image(), {src: url})) }", url)
        with page.expect_response(url + "off") as off:
            page.evaluate("url => { fetch(url, {method: 'POST', mode: 'no-cors'}).catch(() => {}) }", url + "off")
    assert off.value.status == http.client.FORBIDDEN
    assert live.channel.offs == offs
    assert live.channel.pages == (0, False)


def test_page_shows_that_the_run_has_ended_and_the_heater_is_confirmed_off(browser, tmp_path):
    with browser.new_context() as context:
        page = context.new_page()
        with Session(tmp_path) as live:
            page.goto(live.page.url)
            page.get_by_text("controls", exact=True).wait_for(timeout=1000 * PATIENCE_S)
            heat(page, live)
        page.get_by_text("The run has ended. The heater is off, confirmed.").wait_for()
        page.locator("#off").dispatch_event("click")
        page.wait_for_timeout(2000)
        assert page.get_by_text("The run has ended. The heater is off, confirmed.").is_visible()


def test_failed_fit_is_shown(client, live):
    page = client()
    idle_s = live.ticks[-1][1].measurement.time_s
    live.wait(lambda: live.ticks[-1][1].measurement.time_s > idle_s + 10.0)
    fit_s = page.locator(".card", has_text="Fit to the last seconds").locator("input.bk-input").first
    fit_s.fill("10")
    fit_s.press("Enter")
    press(page, "Fit")
    page.locator(".banner", has_text="nothing to fit").wait_for()
    page.locator(".card", has_text="Events").get_by_text("not fitted: no displacement was measured").first.wait_for()
