"""Button events that drive the wire. A click is refused if OFF was pressed after it.

OFF takes a direct path to the driver. A click takes longer, because it passes two event loops. OFF may be pressed in
the meantime, on the same page or on another page. So a click carries the OFF count that the page in the browser had at
the click. The driver refuses the click if the OFF count of the channel differs.

If the user presses OFF, page.html increments the count of its page at once. It delays later clicks until this OFF has
arrived, for at most 3 s. `set_offs` sends the count of all OFFs, also those of other pages, to the browser. If this
count arrives late, the user must click again; an OFF is never lost.
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
    """Values that browser and page process share: `offs` is the OFF count in the browser, `latest` the latest click.

    A click is the name of the button, the OFF count at the click, and the number of the click.
    """

    offs = Int(default=0)
    latest = Tuple(String, Int, Int, default=("", 0, 0))

    def set_offs(self, offs: int) -> None:
        """Send the OFF count `offs` to the browser if it has changed."""
        if self.offs != offs:
            self.offs = offs

    def resend_offs(self, offs: int) -> None:
        """Send the OFF count even if it has not changed. After a refusal, the count in the browser may be wrong."""
        self.offs = -1
        self.offs = offs

    def on(self, button: Button, pressed: Callable[[int], None]) -> None:
        """Call `pressed(offs)` for every click on `button`; `offs` is the OFF count at the click."""
        button.js_on_event("button_click", CustomJS(args={"events": self, "name": button.name}, code=_CLICK))

        def changed(_attribute: str, _old: Any, latest: tuple[str, int, int]) -> None:
            name, offs, _ = latest
            if name == button.name:
                pressed(offs)

        self.on_change("latest", changed)
