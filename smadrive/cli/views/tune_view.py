"""The display of `tune` in its terminal: the state of the heater, live values, the open pages.

The display shows the status that the session publishes and the number of open pages. It needs no open page.
On a terminal the display is live; a pipe or a file gets a line at each change. A thread writes the display: a blocked
terminal or pipe stops that thread, not the loop.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

from rich.console import Console
from rich.text import Text

from smadrive.cli.terminal.output import Output
from smadrive.cli.views.run_view import drawing, is_seen_live
from smadrive.control.loop import Tick
from smadrive.display.number_text import quantity
from smadrive.errors import ConfigError
from smadrive.safety.shutdown import off_text
from smadrive.stream.published_state import PublishedMode
from smadrive.tuning.link.channel import DriverEnd
from smadrive.tuning.processes import TuningPage

CHECK_PERIOD_S = 0.2
"""The time between two checks for a change."""

_HEATER = {
    PublishedMode.OFF: "heater off",
    PublishedMode.HOLDING: "armed, holding",
    PublishedMode.TRACKING: "armed, tracking",
    PublishedMode.UNCONFIRMED: off_text(confirmed=False),
}


class TuneView:
    """The display of a session.

    `channel` gives the status of the session. `page` gives the address of the page, and tells which of its processes
    could not be restarted.
    """

    def __init__(self, name: str, page: TuningPage, channel: DriverEnd) -> None:
        self._name = name
        self._page = page
        self._channel = channel
        self._latest: Tick | None = None

    def tick(self, tick: Tick) -> None:
        """Show the values of this tick from now on."""
        self._latest = tick

    def __rich__(self) -> Text:
        """Return the text of the display at this moment."""
        return Text("\n".join([f"{self._name}: {self.values}", *self._lines()]))

    @property
    def state(self) -> str:
        """The state of the heater, the pages, and the problems, without live values."""
        return "; ".join(self._lines())

    @property
    def values(self) -> str:
        """The measured temperature and current."""
        if self._latest is None or self._channel.published["lost"]:
            return "– °C, – A"
        measured = self._latest.measurement
        temperature = measured.temperature_fault or quantity(measured.temperature_c, 1, "°C")
        return f"{temperature}, {quantity(measured.current_a, 3, 'A')}"

    def _lines(self) -> list[str]:
        status = self._channel.published
        mode = PublishedMode(status["mode"])
        lines = [status["unexpected_current"] or _HEATER[mode], self._pages(heats=mode.heats)]
        if status["fault"]:
            lines.append(f"fault: {status['fault']}")
        if status["lost"]:
            lines.append(f"no answer: {status['lost']}")
        return [*lines, *self._page.troubles]

    def _pages(self, *, heats: bool) -> str:
        count, is_controlled = self._channel.pages
        if count == 0 and heats:
            off_url = self._page.url.split("?")[0] + "off"
            return f"no page is open: the run continues; Ctrl-C or `curl -X POST {off_url}` ends it"
        if count == 0:
            return "no page is open; Ctrl-C ends the session"
        pages = "1 page is open" if count == 1 else f"{count} pages are open"
        return f"{pages}, {'one' if is_controlled else 'none'} controls; Ctrl-C ends the session"


class Changes:
    """Prints the state of the display whenever it has changed."""

    def __init__(self, view: TuneView, say: Callable[[str], None]) -> None:
        self._view = view
        self._say = say
        self._printed = ""

    def print(self) -> None:
        """Print a line if the state differs from the last printed one."""
        state = self._view.state
        if state != self._printed:
            self._printed = state
            self._say(f"{state} ({self._view.values})")


@contextmanager
def watched(view: TuneView, output: Output) -> Iterator[None]:
    """Show `view` during the `with` block, unless `output` is quiet."""
    console = Console(stderr=True)
    if output.quiet:
        yield
    elif is_seen_live(console):
        with drawing(view, console):
            yield
    else:
        with _printing(Changes(view, output.say)):
            yield


@contextmanager
def _printing(changes: Changes) -> Iterator[None]:
    """Print the changes of the state in a thread during the `with` block. If stdout fails, only the printing ends."""
    is_ending = threading.Event()

    def check() -> None:
        with suppress(OSError, ConfigError):
            changes.print()
            while not is_ending.wait(CHECK_PERIOD_S):
                changes.print()

    threading.Thread(target=check, name="terminal", daemon=True).start()
    try:
        yield
    finally:
        is_ending.set()
