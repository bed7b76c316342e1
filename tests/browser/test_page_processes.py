"""Several pages, and processes of the tuning page that are stopped or killed, in a real browser."""

import http.client
import http.server
import os
import signal
import threading
import time

import pytest

from smadrive.tuning.session.modes import Mode

from .conftest import Session, patient_context
from .page_actions import NONE_A, field, heat


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


def test_driver_knows_how_many_pages_are_open(client, live):
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
    live.wait(lambda: len([stamp for stamp, _ in live.ticks if stamp > killed_s]) > 10)
    page.locator("#off").dispatch_event("click")
    live.wait(lambda: not live.session.mode.heats)


def test_page_requested_during_a_restart_loads_when_the_process_answers(browser, live):
    with patient_context(browser) as context:
        for _ in range(2):
            page = context.new_page()
            is_early = False
            while not is_early:  # a busy machine may start the process before the browser asks
                restarts = live.page.server.restarts
                os.kill(live.page.server.pid, signal.SIGKILL)
                is_early = page.goto(live.page.url).status == http.client.SERVICE_UNAVAILABLE
                if not is_early:
                    live.wait(lambda restarts=restarts: live.page.server.restarts > restarts)
            page.get_by_text("controls", exact=True).wait_for()
            assert live.page.server.restarts > restarts
            page.close()


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
    """A web server of another site, with one page."""

    def do_GET(self):
        self.send_response(http.client.OK)
        self.end_headers()
        self.wfile.write(b"<p>elsewhere</p>")

    def log_message(self, *args):
        """Log nothing."""


@pytest.fixture
def elsewhere():
    """The address of a different web server on this machine."""
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), Elsewhere) as server:
        serving = threading.Thread(target=server.serve_forever)
        serving.start()
        yield f"http://127.0.0.1:{server.server_port}/"
        server.shutdown()
        serving.join()


def test_page_of_another_server_can_neither_switch_off_nor_load_pages(browser, live, elsewhere):
    live.wait(lambda: live.channel.pages == (0, False))
    offs, url = live.channel.offs, live.page.url.split("?")[0]
    with patient_context(browser) as context:
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
    with patient_context(browser) as context:
        page = context.new_page()
        with Session(tmp_path) as live:
            page.goto(live.page.url)
            page.get_by_text("controls", exact=True).wait_for()
            heat(page, live)
        page.get_by_text("The run has ended. The heater is off, confirmed.").wait_for()
        page.locator("#off").dispatch_event("click")
        page.wait_for_timeout(2000)
        assert page.get_by_text("connection was lost").count() == 0  # nothing contradicts the end of the run
        assert not page.locator("header .chips").is_visible()
        assert page.get_by_text("The run has ended. The heater is off, confirmed.").is_visible()
