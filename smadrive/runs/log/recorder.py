"""Records a run: rows of numbers, which are buffered for at most a second, and events.

A buffered row costs the control loop microseconds. The buffer is written into the file once a second, or earlier when
it holds `MOST_OPEN_ROWS` rows. So a killed process loses the rows of a second at most. writer.py describes the state of
the file in the meantime.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Self

import numpy as np

from smadrive.errors import DataError
from smadrive.runs.log.layout import MOST_OPEN_ROWS
from smadrive.runs.log.reader import ENDED_BY, INTERRUPTION, RunEvent
from smadrive.runs.log.writer import GROWTH_ROWS, LogFile

BUFFER_S = 1.0

LATEST_EVENTS = 3
"""Number of events that `Recorder.latest` keeps."""


class Recorder:
    """Writes a log of `columns`, the first of which is `time_s`. `metadata` are texts about the run.

    `rows` is the expected number of rows. `latest` holds the last `LATEST_EVENTS` events. DataError when the file
    exists or cannot be created, for example on a full disk.
    """

    def __init__(
        self, path: Path, columns: Sequence[str], metadata: Mapping[str, str] | None = None, rows: int = GROWTH_ROWS
    ) -> None:
        self._buffer: list[tuple[float, ...]] = []
        self._now_s = self._flushed_s = 0.0
        self.latest: deque[RunEvent] = deque(maxlen=LATEST_EVENTS)
        self._file = LogFile(path, columns, metadata or {}, rows)

    def __enter__(self) -> Self:
        """Return the recorder. The end of the context completes and closes the log, also after an error."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Write the buffer and close the log. If an error ended the run, write the error and its notes as events.

        A run that failed before its first row has commanded no current, and leaves no log. The error that ended the run
        is raised again; a failure to complete the log becomes a note of that error.
        """
        try:
            if error is not None and not self._buffer and not self._file.rows:
                self._file.discard()
            else:
                self._end(error)
        except Exception as lost:
            if error is None:
                raise
            if str(lost) != str(error):
                error.add_note(str(lost) if isinstance(lost, DataError) else f"the log is incomplete: {lost!r}")

    def row(self, values: tuple[float, ...]) -> None:
        """Append one row with a value for each column. DataError when the log cannot be written."""
        self._buffer.append(values)
        self._now_s = values[0]
        if self._now_s - self._flushed_s >= BUFFER_S or len(self._buffer) >= MOST_OPEN_ROWS:
            self.flush()

    def event(self, message: str, time_s: float | None = None) -> None:
        """Write an event into the file at once. By default, `time_s` is the latest time of a row or an event."""
        self.flush()
        latest_s = max([self._now_s, *(event.time_s for event in self.latest)])
        event = RunEvent(latest_s if time_s is None else time_s, message)
        self._file.add_event(*event)
        self.latest.append(event)

    def flush(self) -> None:
        """Write every buffered row into the file."""
        self._flushed_s = self._now_s
        if self._buffer:
            block = np.asarray(self._buffer, dtype=np.float64)
            self._buffer.clear()
            self._file.append(block)

    def _end(self, error: BaseException | None) -> None:
        try:
            if error is not None:
                for message in (ENDED_BY + self._cause(error), *getattr(error, "__notes__", ())):
                    self.event(message)
        finally:
            self.close()

    def _cause(self, error: BaseException) -> str:
        """Return the cause of an early end as text."""
        if isinstance(error, KeyboardInterrupt | SystemExit):
            return f"{INTERRUPTION}: Ctrl-C, SIGTERM or a closed terminal"
        return f"{type(error).__name__}: {error}"

    def close(self) -> None:
        """Write the buffer, cut the log to its rows and close it."""
        try:
            self.flush()
        finally:
            self._file.finish()
