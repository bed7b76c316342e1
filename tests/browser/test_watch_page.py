"""The page of `smadrive watch` in a real browser: live values without controls, also for those who come late."""

import subprocess
import sys
import tomllib
from contextlib import ExitStack

import programs
import pytest
from served import PATIENT, served

from smadrive.files.shipped import configs_dir
from smadrive.rig.config import load_rig
from smadrive.rig.rig import Rig
from smadrive.runs.experiments import observe
from smadrive.testing.simulator import ServedSimulator
from smadrive.tuning.link.channel import DriverEnd
from smadrive.tuning.processes import LivePage
from smadrive.tuning.watching import WatchFeed

from .page_actions import newest
from .test_page_layout import BEYOND, OVERLAPS, SIZES

LEFT_S = 30.0
"""The virtual time that was watched before the page is opened."""


@pytest.fixture
def watched(context):
    """A page that is opened after `LEFT_S`, the feed that shows more, and the stack that ends the page's processes."""
    with (
        ServedSimulator("flexinol-lt-0.15mm") as simulator,
        Rig(load_rig("simulated").at(simulator.url), simulator.clock) as rig,
        DriverEnd() as channel,
        ExitStack() as stack,
    ):
        feed = WatchFeed(rig, channel)
        live = stack.enter_context(LivePage(channel, port=0, document={}))
        observe(rig, LEFT_S, feed.tick, lambda: False)
        page = context.new_page()
        page.goto(live.url)
        page.get_by_text("measurements", exact=True).wait_for()
        yield page, feed, stack
        page.close()


def test_page_shows_earlier_values_and_no_control_at_any_size(watched):
    page, *_ = watched
    assert newest(page, "time_s") == pytest.approx(LEFT_S, abs=0.1)
    assert page.locator("#off, input, .bk-Slider").count() == 0
    for width, height in SIZES:
        page.set_viewport_size({"width": width, "height": height})
        page.wait_for_function(f"() => ({BEYOND})() === 0 && ({OVERLAPS})().length === 0")


def test_page_says_that_the_command_has_ended_and_the_heater_is_off(watched):
    page, feed, stack = watched
    assert not page.locator("#connection").is_visible()
    feed.end()
    stack.close()
    page.locator("#connection.good").wait_for()


def test_page_of_a_command_that_ends_normally_says_that_the_heater_is_off(context, tmp_path):
    with served("--pty", str(tmp_path / "port")) as (_, url):
        rig = (configs_dir() / "rigs" / "simulated.toml").read_text()
        (tmp_path / "rig.toml").write_text(rig.replace(tomllib.loads(rig)["devices"][0]["url"], url + PATIENT))
        command = [sys.executable, "-m", "smadrive", "watch", "rig.toml", "--page", "--port", "0", "--no-browser"]
        with programs.Program(command, cwd=tmp_path, stdout=subprocess.PIPE, text=True) as watching:
            address = watching.stdout.readline().split()[-1]
            page = context.new_page()
            page.goto(address)
            page.get_by_text("measurements", exact=True).wait_for()
            context.request.post(f"{address.rstrip('/')}/off")
            page.locator("#connection.good").wait_for()
            page.close()
            watching.communicate()
    assert watching.returncode == 0
