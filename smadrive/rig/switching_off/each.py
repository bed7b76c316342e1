"""Calls a function for every item, even if it fails for one of them."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import TypeVar

DeviceT = TypeVar("DeviceT")
ResultT = TypeVar("ResultT")


def each(devices: Iterable[DeviceT], act: Callable[[DeviceT], ResultT]) -> tuple[list[ResultT], Exception | None]:
    """Call `act` for every device, even after an error. Return the results, and the first error or None."""
    results: list[ResultT] = []
    failure: Exception | None = None
    for device in devices:
        try:
            results.append(act(device))
        except Exception as error:  # noqa: BLE001  (whatever the error is, the other devices must be switched off)
            failure = failure or error
    return results, failure
