"""Waiting for a condition, and for the end of a log that another process writes."""

import time
from contextlib import suppress

from smadrive.errors import DataError
from smadrive.runs.log.reader import read_log


def wait_for(condition):
    """Wait until `condition()` is true."""
    while not condition():
        time.sleep(0.01)


def has_ended(log_file):
    """Return True if the log is complete. Its writer may just be changing the structure of the file (see writer.py)."""
    with suppress(DataError):
        return bool(read_log(log_file).end_time)
    return False
