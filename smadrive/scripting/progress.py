"""The progress of a run: a line in a terminal, a bar in a notebook, nothing elsewhere.

The display belongs to the script. The loop runs in another process, so a slow display delays no tick.
"""

from __future__ import annotations

import html
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from importlib import import_module
from math import inf, isfinite
from typing import Any

from rich.console import Console
from rich.live import Live
from rich.text import Text

from smadrive.display.card import FONT
from smadrive.display.number_text import quantity
from smadrive.scripting.loop.client.loop_client import Show
from smadrive.scripting.loop.messages import RunProgress

BAR = 30
"""Length of the bar in a terminal, in characters."""

DRAWN_EVERY_S = 0.2


def progress_text(title: str, progress: RunProgress) -> str:
    """Return one line: title, time, temperature, displacement, current. An estimated displacement is named so."""
    tick, measured, duration_s = progress.tick, progress.tick.measurement, progress.duration_s
    time_s = min(tick.time_s, duration_s)  # the last tick may come after the end
    length = f" of {duration_s:.1f}" if isfinite(duration_s) else ""
    estimated = "estimated " if isfinite(tick.reached_mm) and not isfinite(tick.measured_mm) else ""
    values = (
        quantity(measured.temperature_c, 1, "°C"),
        f"{estimated}{quantity(tick.reached_mm, 2, 'mm')}",
        quantity(measured.current_a, 3, "A"),
    )
    return f"{title}: {time_s:.1f}{length} s · {' · '.join(values)}"


def share_done(progress: RunProgress) -> float:
    """Return the elapsed fraction of the run, 0 to 1; 0 for a run without an end."""
    return min(progress.tick.time_s / progress.duration_s, 1.0) if isfinite(progress.duration_s) else 0.0


@contextmanager
def shown_progress(title: str) -> Iterator[Show | None]:
    """Yield a function that shows the progress of a run; None if nobody sees it. The `with` block ends the display."""
    console = Console(stderr=True)
    if is_notebook():
        with _in_notebook(title) as show:
            yield show
    elif console.is_terminal:
        with _in_terminal(title, console) as show:
            yield show
    else:
        yield None


def is_notebook() -> bool:
    """Return True if this process is the kernel of a notebook."""
    ipython = sys.modules.get("IPython")
    shell = ipython.get_ipython() if ipython is not None else None
    return type(shell).__name__ == "ZMQInteractiveShell"


@contextmanager
def _in_terminal(title: str, console: Console) -> Iterator[Show]:
    live = Live(console=console, auto_refresh=False, transient=True)

    def show(progress: RunProgress) -> None:
        done = round(BAR * share_done(progress))
        line = Text(no_wrap=True, overflow="ellipsis")
        line.append("━" * done, "green").append("━" * (BAR - done), "dim")
        line.append(f"  {progress_text(title, progress)}")
        with suppress(OSError):
            live.update(line, refresh=True)

    with suppress(OSError):
        live.start()
    try:
        yield _paced(show)
    finally:
        with suppress(OSError):
            live.stop()


@contextmanager
def _in_notebook(title: str) -> Iterator[Show]:
    display: Any = import_module("IPython.display")  # every notebook has IPython
    handle = display.display(display.HTML(_html(title, None)), display_id=True)
    latest: list[RunProgress] = []

    def show(progress: RunProgress) -> None:
        latest[:] = [progress]
        handle.update(display.HTML(_html(title, progress)))

    try:
        yield _paced(show)
    finally:
        handle.update(display.HTML(_html(title, latest[0] if latest else None, is_over=True)))


def _html(title: str, progress: RunProgress | None, *, is_over: bool = False) -> str:
    text = html.escape(title if progress is None or is_over else progress_text(title, progress))
    share = 0.0 if progress is None else share_done(progress)
    bar = "" if is_over else f"<progress value='{share:.3f}' max='1' style='width:14em'></progress> "
    return f"<div style='{FONT};font-variant-numeric:tabular-nums'>{bar}{text}{': ended' if is_over else ''}</div>"


def _paced(show: Show) -> Show:
    """Return `show`, called at most every `DRAWN_EVERY_S`."""
    drawn_s = -inf

    def paced(progress: RunProgress) -> None:
        nonlocal drawn_s
        if time.monotonic() - drawn_s >= DRAWN_EVERY_S:
            drawn_s = time.monotonic()
            show(progress)

    return paced
