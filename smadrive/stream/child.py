"""The common part of all child processes of the control process (see supervised_process.py).

A child reads one line of parameters from standard input, and writes one line when it is ready. Its standard input
ends when the control process dies or closes it; then the child ends without a message.
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
    """Call `serve` with the parameters. If the control process dies before it sends parameters, return at once."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    line = sys.stdin.readline()
    if line:
        with suppress(BrokenPipeError):
            serve(json.loads(line))


def report_ready() -> None:
    """Write the line that the control process waits for. BrokenPipeError when the control process has died."""
    os.write(sys.stdout.fileno(), b"{}\n")


def is_input_closed(within_s: float) -> bool:
    """Wait for the end of standard input, at most `within_s`. Return True if standard input has ended."""
    return bool(select.select([sys.stdin], [], [], within_s)[0])
