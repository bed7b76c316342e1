"""The end of the main thread, also while a pool of threads keeps the script alive.

Only the main thread gets Ctrl-C and the signals of the script, so no run of another thread may go on after its end. The
interpreter waits for the pools of `concurrent.futures` before it marks the main thread as ended. So a hook that is
private to CPython notes the end before that. Hooks are called in reverse order: those of the pools, which the imports
below register, are called after this one.
"""

from __future__ import annotations

import concurrent.futures.process
import concurrent.futures.thread  # noqa: F401
import threading

from smadrive.errors import SafetyError

_ended = threading.Event()
threading._register_atexit(_ended.set)  # type: ignore[attr-defined]  # noqa: SLF001


def main_thread_has_ended() -> bool:
    """Return True if the main thread of this process has ended."""
    return _ended.is_set() or not threading.main_thread().is_alive()


def outlives_script() -> SafetyError:
    """Return the error of a request that has ended because the main thread has."""
    cure = "let the main thread wait until the run has ended, by join() of its thread"
    return SafetyError("the main thread of the script has ended", where="loop process", cure=cure)
