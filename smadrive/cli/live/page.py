"""The page of a command in the browser: the checks before it is opened, and the page of `watch`."""

from __future__ import annotations

import threading
import webbrowser
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager

from smadrive.cli.terminal.output import Output
from smadrive.clock import VirtualClock
from smadrive.errors import ConfigError
from smadrive.rig.rig import Rig
from smadrive.tuning.link.channel import DriverEnd
from smadrive.tuning.processes import LivePage
from smadrive.tuning.watching import WatchFeed


def check_real_time(rig: Rig) -> None:
    """Raise ConfigError if the rig runs in virtual time, which is too fast for a user to watch."""
    if isinstance(rig.clock, VirtualClock):
        raise ConfigError(
            "the page needs real time, but the time of sim:// is virtual",
            where=f"rig '{rig.config.name}'",
            cure="serve the simulated device with `firmware-sim SIM --pty PATH`, and write "
            'url = "serial://PATH" for this device in the rig file',
        )


@contextmanager
def opened(page: LivePage, rig: Rig, output: Output, *, browser: bool) -> Iterator[None]:
    """Start the processes of the page, print its address and, with `browser`, open it in the browser.

    The start takes a second, or a minute if other programs keep every core busy. A terminal shows that it goes on.
    """
    with ExitStack() as stack:
        with output.progress("starting the page"):
            stack.enter_context(page)
        output.say(f"{rig.config.name}: {page.url}")
        if browser:
            open_browser(page.url)
        yield


def open_browser(url: str) -> None:
    """Open the address in the browser from a thread: a text browser, or a program in $BROWSER, returns at its end."""
    threading.Thread(target=webbrowser.open, args=(url,), name="browser", daemon=True).start()


@contextmanager
def watched_on_page(rig: Rig, port: int, output: Output, *, browser: bool) -> Iterator[WatchFeed]:
    """Open the page of `watch`, and yield the feed that sends each measurement to it."""
    check_real_time(rig)
    with DriverEnd() as channel:
        feed = WatchFeed(rig, channel)
        with opened(LivePage(channel, port=port, document={}), rig, output, browser=browser):
            yield feed
