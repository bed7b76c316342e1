"""The common part of the child processes that supervised_process.py starts.

Their parent is the driver. A child reads one line of parameters from standard input, and writes one line to standard
output when it is ready. Standard input ends when the driver closes it or dies. Then the child ends without an error
message.
"""

from __future__ import annotations

import json
import os
import select
import signal
import sys
from collections.abc import Callable
from contextlib import suppress
from typing import Any


def run(serve: Callable[[dict[str, Any]], None]) -> None:
    """Call `serve` with the parameters from standard input. Return if the driver dies before it sends them."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    line = sys.stdin.readline()
    if line:
        with suppress(BrokenPipeError):
            serve(json.loads(line))


def report_ready() -> None:
    """Write the line that the driver waits for. BrokenPipeError when the driver has died."""
    os.write(sys.stdout.fileno(), b"{}\n")


def is_input_closed(within_s: float) -> bool:
    """Wait for the end of standard input, at most `within_s`. Return True if standard input has ended."""
    return bool(select.select([sys.stdin], [], [], within_s)[0])
