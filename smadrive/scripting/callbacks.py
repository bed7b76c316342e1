"""Calls of functions of the user in a thread that must go on: an error is shown, and ends nothing."""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable
from typing import Any


def succeeds(call: Callable[..., Any], *arguments: Any) -> bool:
    """Call `call` with the arguments, and return True. Return False after an error, which `threading.excepthook` shows.

    The thread of the link to the loop process calls functions of the user. If an error ended this thread, the script
    could neither stop the run nor learn its state, while the wire is heated.
    """
    try:
        call(*arguments)
    except BaseException:  # noqa: BLE001 (also SystemExit: the thread must go on)
        threading.excepthook(threading.ExceptHookArgs((*sys.exc_info(), threading.current_thread())))
        return False
    return True
