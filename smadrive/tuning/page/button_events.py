"""Presses of the buttons that drive the wire. None of them overtakes an OFF.

OFF counts at once, but a click reaches the control process some turns of two event loops after it was made, and an OFF
may be made meanwhile, on this page or elsewhere. So a click brings with it how many OFFs its page knew of when it was
made, a number that has been in the browser; the control process refuses it unless those are all there are.

A page knows of its own OFF as soon as it is pressed (page.html), and holds back what is pressed next until that OFF has
arrived; of others it is told by `know`. What it is told too late costs one press more, never an OFF.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from bokeh.core.properties import Int, String, Tuple
from bokeh.model import DataModel
from bokeh.models import Button, CustomJS

_PRESS = """
const press = [name, presses.offs, presses.latest[2] + 1];
switchedOff.then(() => { presses.latest = press; });
"""


class ButtonEvents(DataModel):  # type: ignore[misc]  # bokeh has no type for it
    """In the browser as here: how many OFFs the page knows of, and the latest press (button, OFFs known, number)."""

    offs = Int(default=0)
    latest = Tuple(String, Int, Int, default=("", 0, 0))

    def know(self, offs: int) -> None:
        """Tell the page how many OFFs there have been."""
        if self.offs != offs:
            self.offs = offs

    def know_again(self, offs: int) -> None:
        """Tell it after a refusal, whatever it seems to know: its own count may have crossed what it was told."""
        self.offs = -1
        self.offs = offs

    def on(self, button: Button, pressed: Callable[[int], None]) -> None:
        """Have `pressed(offs)` called for every press of `button`, with the OFFs that its page knew of."""
        button.js_on_event("button_click", CustomJS(args={"presses": self, "name": button.name}, code=_PRESS))

        def changed(_attribute: str, _old: Any, latest: tuple[str, int, int]) -> None:
            name, offs, _ = latest
            if name == button.name:
                pressed(offs)

        self.on_change("latest", changed)
