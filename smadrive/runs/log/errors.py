"""Errors of a file that cannot be read as a log. The reader turns each of them into a DataError."""

from __future__ import annotations


class DamageError(Exception):
    """The content differs from what the writer wrote.

    `place` names the damaged part, for example a sample or an event. It is empty when no single part is damaged.
    """

    def __init__(self, what: str, place: str = "") -> None:
        super().__init__(what)
        self.place = place


class ForeignContentError(Exception):
    """The file refers to content outside of itself, uses a filter, or has more bytes, levels or links than any log."""


class NewerLayoutError(Exception):
    """A later version of smadrive wrote the log; `layout` is the number of its layout."""

    def __init__(self, layout: int) -> None:
        super().__init__(f"layout {layout}")
        self.layout = layout
