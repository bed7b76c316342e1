"""Calls of functions of the user in a thread that must go on: an error is shown, and ends nothing.

The thread of the link to the loop process calls functions of the user. It is the only thread that receives reports and
replies. So a function that waits for one of them here would wait for ever, while the wire is heated: it gets an error.
"""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable
from typing import Any

from smadrive.errors import MotionError


class _Calls(threading.local):
    """The number of functions of the user that the present thread calls by `succeeds`, one inside the other."""

    depth = 0


_calls = _Calls()


def succeeds(call: Callable[..., Any], *arguments: Any) -> bool:
    """Call `call` with the arguments, and return True. Return False after an error, which `threading.excepthook` shows.

    If an error ended the thread, the script could neither stop the run nor learn its state, while the wire is heated.
    """
    _calls.depth += 1
    try:
        call(*arguments)
    except BaseException:  # noqa: BLE001 (also SystemExit: the thread must go on)
        threading.excepthook(threading.ExceptHookArgs((*sys.exc_info(), threading.current_thread())))
        return False
    finally:
        _calls.depth -= 1
    return True


def is_callback() -> bool:
    """Return True in a function of the user that `succeeds` calls."""
    return _calls.depth > 0


def check_may_wait(where: str) -> None:
    """Raise MotionError in a function of the user that `succeeds` calls. `where` is what it would wait for."""
    if is_callback():
        what = "a function that is called with a tick or at the end of a motion must not wait"
        raise MotionError(what, where=where, cure="wait in the script itself, or in a thread of its own")
