"""Adds a run to the health record of its wire. The record is a side product: no failure here makes a run fail.

The log of the run names the model file. The entry is made from the log after the run, so it does not delay the loop.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from smadrive.errors import ConfigError, SmadriveError
from smadrive.runs.health.assessment import is_identified
from smadrive.runs.health.entries import identification_entry, run_entry
from smadrive.runs.log.reader import read_log
from smadrive.runs.run_log import WIRE_FILE
from smadrive.wire.health.record import append_entries, read_health


@contextmanager
def health_recorded(log_file: Path, warn: Callable[[Iterable[str]], None]) -> Iterator[None]:
    """Add the run in `log_file` to the record of its wire at the end of the `with` block, however the run ends.

    `warn` is called with the reason if the run cannot be added, otherwise with an empty tuple.
    """
    try:
        yield
    finally:
        with suppress(ConfigError, OSError):  # of a broken stdout
            warn(record_health(log_file))


def record_health(log_file: Path) -> tuple[str, ...]:
    """Add the run in `log_file` to the health record of its wire. If that is impossible, return the reason.

    Nothing is added for a run without rows, and for a wire without a file.
    """
    if not log_file.exists():
        return ()
    try:
        return _recorded(log_file)
    except SmadriveError as error:
        return (str(error),)
    except Exception as error:  # noqa: BLE001 (a defect of the record must not spoil the run)
        return (f"{log_file.name}: the health of the wire is not recorded: {type(error).__name__}: {error}",)


def _recorded(log_file: Path) -> tuple[str, ...]:
    log = read_log(log_file)
    if WIRE_FILE not in log.metadata or not log.column("time_s").size:
        return ()
    wire_file = Path(log.metadata[WIRE_FILE])
    run, identified, record = run_entry(log, wire_file), identification_entry(wire_file), read_health(wire_file)
    entries = [run] if is_identified(record.entries, identified) else [identified, run]
    append_entries(wire_file, entries)
    return ()
