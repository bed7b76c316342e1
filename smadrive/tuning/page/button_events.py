"""Button events that drive the wire. None of them overtakes an OFF.

OFF acts at once, but a click passes two event loops before it reaches the control process, and OFF may be pressed
meanwhile, on this page or elsewhere. So a click carries the count of OFFs that its page knew in the browser; the
control process refuses it unless that is the present count.

A page counts its own OFF as soon as it is pressed (page.html), and delays later clicks until that OFF has arrived; the
OFFs of other pages reach it by `set_offs`. A count that arrives late costs one more click, never an OFF.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from bokeh.core.properties import Int, String, Tuple
from bokeh.model import DataModel
from bokeh.models import Button, CustomJS

_CLICK = """
const click = [name, events.offs, events.latest[2] + 1];
switchedOff.then(() => { events.latest = click; });
"""


class ButtonEvents(DataModel):  # type: ignore[misc]  # bokeh has no type for it
    """Shared with the browser: the count of OFFs that it knows, and the latest click (button, that count, number)."""

    offs = Int(default=0)
    latest = Tuple(String, Int, Int, default=("", 0, 0))

    def set_offs(self, offs: int) -> None:
        """Send the count of OFFs to the page if it has changed."""
        if self.offs != offs:
            self.offs = offs

    def resend_offs(self, offs: int) -> None:
        """Send the count after a refusal in any case: the page's own count may be wrong."""
        self.offs = -1
        self.offs = offs

    def on(self, button: Button, pressed: Callable[[int], None]) -> None:
        """Call `pressed(offs)` for every click on `button`, with the count of OFFs that its page knew."""
        button.js_on_event("button_click", CustomJS(args={"events": self, "name": button.name}, code=_CLICK))

        def changed(_attribute: str, _old: Any, latest: tuple[str, int, int]) -> None:
            name, offs, _ = latest
            if name == button.name:
                pressed(offs)

        self.on_change("latest", changed)
