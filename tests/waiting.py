"""Waiting for a condition, and for a log that another process writes."""

import time
from contextlib import suppress

from smadrive.errors import DataError
from smadrive.runs.log.reader import read_log


def wait_for(condition):
    """Wait until `condition()` is true."""
    while not condition():
        time.sleep(0.01)


def has_ended(log_file):
    """Return True if the log is complete."""
    return any(log.end_time for log in readable(log_file))


def has_rows(log_file):
    """Return True if the run has begun, and its first second is in the log."""
    return any(len(log.column("time_s")) for log in readable(log_file))


def readable(log_file):
    """Yield the log, or nothing while its writer changes the structure of the file (see writer.py)."""
    with suppress(DataError):
        yield read_log(log_file)
