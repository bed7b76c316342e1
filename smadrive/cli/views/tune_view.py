"""What `tune` tells in its terminal while it lasts: the heater, the wire, the pages that are open.

The loop goes on without a page, so the terminal must not need one to tell the truth. It tells what the loop publishes
to every page and what the page process says of its clients, live on a terminal and otherwise as a line on stdout
whenever it changes. As in a run a thread does that: a terminal that stands still, or a pipe that nobody reads, stops
that thread, not the loop.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

from rich.console import Console
from rich.text import Text

from smadrive.cli.output import Output
from smadrive.cli.views.run_view import drawing, number
from smadrive.control.loop import Tick
from smadrive.errors import ConfigError
from smadrive.tuning.link.channel import ControlEnd
from smadrive.tuning.processes import TuningPage

LOOKED_S = 0.2
"""How often it is looked whether there is anything new to say."""

_HEATER = {
    "off": "heater off",
    "holding": "armed, holding",
    "tracking": "armed, tracking",
    "off, unconfirmed": "the heater could NOT be confirmed off: cut its supply",
}


class TuneView:
    """The picture of a session on `channel` with its `page`."""

    def __init__(self, name: str, page: TuningPage, channel: ControlEnd) -> None:
        self._name = name
        self._page = page
        self._channel = channel
        self._latest: Tick | None = None

    def tick(self, tick: Tick) -> None:
        """The latest tick: its values are shown."""
        self._latest = tick

    def __rich__(self) -> Text:
        """The picture now."""
        return Text("\n".join([f"{self._name}: {self.values}", *self._told()]))

    @property
    def state(self) -> str:
        """What holds until something happens: the heater, the pages, what is wrong."""
        return "; ".join(self._told())

    @property
    def values(self) -> str:
        """Temperature and current, as they are measured now."""
        if self._latest is None or self._channel.published["lost"]:
            return "– °C, – A"
        measured = self._latest.measurement
        temperature = measured.temperature_fault or number(measured.temperature_c, 1, "°C")
        return f"{temperature}, {number(measured.current_a, 3, 'A')}"

    def _told(self) -> list[str]:
        status = self._channel.published
        told = [_HEATER[status["mode"]], self._pages(heats=status["mode"] in {"holding", "tracking"})]
        if status["fault"]:
            told.append(f"fault: {status['fault']}")
        if status["lost"]:
            told.append(f"no answer: {status['lost']}")
        return [*told, *self._page.troubles]

    def _pages(self, *, heats: bool) -> str:
        count, is_controlled = self._channel.pages
        if count == 0 and heats:
            off_url = self._page.url.split("?")[0] + "off"
            return f"no page is open: the wire is driven on; Ctrl-C or `curl -X POST {off_url}` ends it"
        if count == 0:
            return "no page is open; Ctrl-C ends"
        pages = "1 page is open" if count == 1 else f"{count} pages are open"
        return f"{pages}, {'one' if is_controlled else 'none'} controls; Ctrl-C ends"


class Changes:
    """Says what changed since it last said anything."""

    def __init__(self, view: TuneView, say: Callable[[str], None]) -> None:
        self._view = view
        self._say = say
        self._said = ""

    def tell(self) -> None:
        """A line, if the state is another one than before."""
        state = self._view.state
        if state != self._said:
            self._said = state
            self._say(f"{state} ({self._view.values})")


@contextmanager
def watched(view: TuneView, output: Output) -> Iterator[None]:
    """Show `view` while the block lasts."""
    console = Console(stderr=True)
    if output.quiet:
        yield
    elif console.is_terminal:
        with drawing(view, console):
            yield
    else:
        with _lines(Changes(view, output.say)):
            yield


@contextmanager
def _lines(changes: Changes) -> Iterator[None]:
    """Look for changes until the block ends; a stdout that takes no more ends that alone."""
    is_ending = threading.Event()

    def look() -> None:
        with suppress(OSError, ConfigError):
            changes.tell()
            while not is_ending.wait(LOOKED_S):
                changes.tell()

    threading.Thread(target=look, name="terminal", daemon=True).start()
    try:
        yield
    finally:
        is_ending.set()
