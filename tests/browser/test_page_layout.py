"""The layout and the plots of the tuning page in a real browser."""

import os
import signal

import pytest

from .page_actions import drawn, errors, heat, newest, press


def test_page_loads_nothing_from_elsewhere_and_its_plots_move(client, live):
    page = client()
    assert page.requests
    assert not [url for url in page.requests if not url.startswith(live.page.url.split("?")[0])]
    first = newest(page, "time_s")
    live.wait(lambda: newest(page, "time_s") > first + 1.0)


BEYOND = """() => [...document.querySelectorAll("header > *, .number, .card")].filter(
    element => element.getBoundingClientRect().right > innerWidth).length"""
"""A script that counts the elements that are wider than the window."""


@pytest.fixture
def page_of_each_width(client):
    """`page_of_each_width(widths)` yields each width with one page, whose window has that width."""

    def resized(widths):
        page = client()
        for width in widths:
            page.set_viewport_size({"width": width, "height": 800})
            page.wait_for_function("width => innerWidth === width", arg=width)
            yield width, page

    return resized


def test_nothing_is_cut_off_at_any_window_width(page_of_each_width, live):
    for width, page in page_of_each_width([390, 700, 1000, 1280, 1600]):
        live.wait(lambda page=page: page.evaluate(BEYOND) == 0)  # a style is applied some time after the change
        for card in page.locator(".card").all():
            card.scroll_into_view_if_needed()
            live.wait(lambda card=card: card.bounding_box()["height"] > 80)
        live.wait(lambda page=page, width=width: page.evaluate("document.documentElement.scrollWidth") <= width)
        page.get_by_text("Events", exact=True).scroll_into_view_if_needed()
        live.wait(lambda page=page: page.locator("#off").bounding_box()["y"] < 40)


def test_plots_and_controls_fill_a_narrow_window(page_of_each_width, live):
    for width, page in page_of_each_width([390, 700]):
        for card in (page.locator(".plot").first, page.locator(".run")):
            live.wait(lambda card=card, width=width: card.bounding_box()["width"] > 0.9 * width)


OVERLAPS = """() => {
    const places = [...document.querySelectorAll("header > *, .number, .card")].map(
        element => [element, element.getBoundingClientRect()]);
    const overlap = (a, b) => Math.min(a.right, b.right) > Math.max(a.left, b.left) + 1
        && Math.min(a.bottom, b.bottom) > Math.max(a.top, b.top) + 1;
    return places.flatMap(([element, place], n) => places.slice(n + 1).filter(([other, there]) =>
        element.parentNode.tagName === other.parentNode.tagName
        && overlap(place, there)).map(([other]) => [element.innerText, other.innerText])) }"""
"""A script that returns the pairs of head parts or cards that overlap."""


OVER_OFF = """() => {
    const off = document.getElementById("off"), place = off.getBoundingClientRect();
    const shares = [0.05, 0.5, 0.95];
    return shares.flatMap(x => shares.map(y => document.elementFromPoint(
        place.left + x * place.width, place.top + y * place.height))).filter(top => !off.contains(top)).length }"""
"""A script that counts at how many of nine points something covers OFF."""


def test_nothing_overlaps_at_any_window_width(page_of_each_width, live):
    for _, page in page_of_each_width([390, 700, 720, 1000, 1280, 1600]):
        live.wait(lambda page=page: page.evaluate(OVERLAPS) == [])
        live.wait(lambda page=page: page.evaluate(OVER_OFF) == 0)


SIZES = ((1920, 1080), (1440, 900), (1024, 768), (700, 900), (390, 844))

NEEDED = "#off, header .chips, .number, .times, .plot, .run, .knobs"
"""The elements that a running session needs."""

LONGEST = [["−135.0", "estimated"], ["−12.34", "estimated"], ["−0.000", "commanded"], ["−12.34", "no setpoint"]]
"""The longest numbers and states."""

GEOMETRY = """([needed, longest]) => {
    showNumbers(longest.map(texts => [...texts, ""]));
    const outside = ({left, top, right, bottom}) => left < 0 || top < 0 || right > innerWidth || bottom > innerHeight;
    const place = (element) => element.getBoundingClientRect();
    const all = (selector) => [...document.querySelectorAll(selector)];
    const apart = (a, b) => Math.min(a.right, b.right) <= Math.max(a.left, b.left) + 1
        || Math.min(a.bottom, b.bottom) <= Math.max(a.top, b.top) + 1;
    const parts = all("header > *, .number, .times, .card");
    const names = (elements) => elements.map(element => element.innerText);
    const off = place(document.getElementById("off"));
    return {
        width: innerWidth,
        isOffOutside: outside(off),
        scrollsSideways: document.documentElement.scrollWidth > innerWidth,
        overOff: names(parts.filter(part => part.id !== "off" && !apart(off, place(part)))),
        overlapping: parts.flatMap((part, n) =>
            names(parts.slice(n + 1).filter(other => !apart(place(part), place(other))))),
        cut: names(all(".number b, .number h2, .number .state").filter(part =>
            place(part).right > place(part.closest(".number")).right - 4 || part.scrollWidth > part.clientWidth)),
        outside: names(all(needed).filter(one => outside(place(one)))),
    } }"""
"""A script that returns what lies where. `outside` are the needed elements that are not wholly inside the window."""


def test_off_is_in_reach_and_nothing_overlaps_in_a_running_session(client, live):
    page = client()
    heat(page, live)
    page.locator(".number .state", has_text="measured").nth(3).wait_for()
    for width, height in SIZES:
        page.set_viewport_size({"width": width, "height": height})
        right = {"width": width, "isOffOutside": False, "scrollsSideways": False}
        right |= {"overOff": [], "overlapping": [], "cut": []}

        def is_right(right=right):
            found = page.evaluate(GEOMETRY, [NEEDED, LONGEST])
            return {key: found[key] for key in right} == right

        live.wait(is_right)
        live.wait(lambda: page.evaluate(OVER_OFF) == 0)
        if (width, height) in SIZES[:2]:
            live.wait(lambda: page.evaluate(GEOMETRY, [NEEDED, LONGEST])["outside"] == [])


def test_large_numbers_are_those_of_the_wire_and_vanish_with_their_process(client, live):
    page = client()
    value = page.locator(".number", has_text="temperature").locator(".value")
    live.wait(lambda: value.inner_text() not in {"", "—"})
    assert abs(float(value.inner_text()) - live.ticks[-1][1].measurement.temperature_c) < 5.0
    os.kill(live.page.server.pid, signal.SIGSTOP)
    try:
        value.wait_for(state="hidden")
    finally:
        os.kill(live.page.server.pid, signal.SIGCONT)
    value.wait_for()


def test_page_that_watched_before_shows_active_widgets_in_the_accent_colour(client, live):
    first, page = client(), client(says="watches")
    first.close()
    arm = page.get_by_role("button", name="Arm", exact=True)
    live.wait(arm.is_enabled)
    colour = "element => getComputedStyle(element).backgroundColor"
    for element in (page.locator(".noUi-connect").first, arm):
        live.wait(lambda element=element: element.evaluate(colour) == "rgb(11, 143, 135)")


def test_page_opened_later_draws_the_same_errors(client, live):
    page = client()
    heat(page, live)
    live.wait(lambda: len(errors(page)) > 20)
    late, early = errors(client(token=False)), errors(page)
    both = late.keys() & early.keys()
    assert len(both) > 20
    assert {time_s: late[time_s] for time_s in both} == pytest.approx({time_s: early[time_s] for time_s in both})


def test_paused_plots_stand_still_and_look_back_until_resume(client, live):
    page = client()
    live.wait(lambda: newest(page, "time_s") > 3.0)
    press(page, "Pause")
    page.get_by_role("button", name="Resume").wait_for()
    paused_s, started_s = newest(page, "time_s"), live.time_s
    live.wait(lambda: live.time_s > started_s + 4.0)
    assert newest(page, "time_s") < paused_s + 1.0
    press(page, "All")
    live.wait(lambda: drawn(page, "time_s")[0][0] < 0.2 and newest(page, "time_s") > paused_s + 3.0)
    press(page, "Resume")
    shown = newest(page, "time_s")
    live.wait(lambda: newest(page, "time_s") > shown + 2.0)
