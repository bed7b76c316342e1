"""The reasons why a file cannot be read as a log; the reader makes a DataError of each."""

from __future__ import annotations


class DamageError(Exception):
    """The content differs from what was written; `place` is a sample, an event, ..., or empty for the whole log."""

    def __init__(self, what: str, place: str = "") -> None:
        super().__init__(what)
        self.place = place


class ForeignContentError(Exception):
    """The file refers to content outside of itself, or claims more than it holds."""


class NewerLayoutError(Exception):
    """A later version of smadrive wrote the log; `layout` is the number of its layout."""

    def __init__(self, layout: int) -> None:
        super().__init__(f"layout {layout}")
        self.layout = layout
