"""Calls a function for every item, even if it fails for one of them."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import TypeVar

ItemT = TypeVar("ItemT")
ResultT = TypeVar("ResultT")


def each(items: Iterable[ItemT], act: Callable[[ItemT], ResultT]) -> tuple[list[ResultT], Exception | None]:
    """Call `act` for every item, even after an error. Return the results, and the first error or None."""
    results: list[ResultT] = []
    failure: Exception | None = None
    for item in items:
        try:
            results.append(act(item))
        except Exception as error:  # noqa: BLE001  (whatever the error is, the other items follow)
            failure = failure or error
    return results, failure
