"""What a user does on the tuning page, and what a user sees there."""

import http.client
import http.server
import math
import re
import urllib.parse

from smadrive.tuning.session.modes import Mode

from .conftest import PATIENCE_S

NONE_A = 0.002


def press(page, name):
    """Click a button as soon as it is enabled, without waiting until its position is stable."""
    page.locator("button:enabled", has_text=re.compile(f"^{name}$")).dispatch_event("click")


def choose(page, source):
    """Press the button of a source of the displacement."""
    page.locator(".bk-btn", has_text=re.compile(f"^{source}$")).click()


def field(page, name):
    """Return the field of the knob whose slider has this title."""
    row = page.locator(".bk-Row", has=page.get_by_text(name))
    return row.locator("input.bk-input").last


def turn(page, name, value):
    field(page, name).fill(str(value))
    field(page, name).press("Enter")


def name(page, text):
    page.get_by_placeholder("name of the new files").fill(text)
    page.get_by_placeholder("name of the new files").press("Tab")


def opened_editor(page, cell):
    """Open the field in which a cell of a table is edited. Double click until the table opens the field."""
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
    """Return columns of the data that the browser draws, all at one moment."""
    script = """columns => { for (const model of Bokeh.documents[0]._all_models.values())
        if (model.type === "ColumnDataSource" && columns.every(column => model.data[column]))
            return columns.map(column => Array.from(model.data[column])) }"""
    return page.evaluate(script, columns)


def newest(page, column):
    return drawn(page, column)[0][-1]


def errors(page):
    """Return each error that the page draws, by its time."""
    pairs = zip(*drawn(page, "time_s", "error_percent"), strict=True)
    return {time_s: percent for time_s, percent in pairs if math.isfinite(percent)}


def post_off(live, **headers):
    """Send POST /off as curl does, and return the status of the reply."""
    connection = http.client.HTTPConnection("127.0.0.1", urllib.parse.urlsplit(live.page.url).port, timeout=PATIENCE_S)
    connection.request("POST", "/off", headers=headers)
    status = connection.getresponse().status
    connection.close()
    return status


def cells(page, column):
    """Return the numbers that a column of the table of rules shows in its first rows."""
    return [float(text) for text in page.locator(f".slick-cell.l{column}").all_inner_texts()[:4]]
