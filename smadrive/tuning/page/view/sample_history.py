"""The samples of the whole session, in a bounded memory.

At least the newest `FULL_ROWS` samples are kept unchanged. Older samples are reduced: of each short interval, only the
samples with the extremes of the measured values are kept, so that spikes stay visible. The longer the session, the
longer the intervals; all intervals have about the same length.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from smadrive.stream.samples import COLUMN, COLUMNS, Rows
from smadrive.tuning.link.channel import PageEnd

FULL_ROWS = 1 << 16
"""At least this number of the newest samples is never reduced: 54 minutes at 20 Hz, 10.9 minutes at 100 Hz."""

CAPACITY = 2 * FULL_ROWS

EXTREMES_OF = tuple(COLUMN[name] for name in ("temperature_c", "displacement_mm", "current_a"))

_TIME = COLUMN["time_s"]


class SampleHistory:
    """The samples that the page process has read from `channel`. It is shared by all pages."""

    def __init__(self, channel: PageEnd) -> None:
        self._channel = channel
        self._seen = 0
        self._rows = np.empty((CAPACITY, len(COLUMNS)))
        self._count = 0
        self._old = np.empty((0, len(COLUMNS)))
        self._factor = 1

    def __len__(self) -> int:
        """Return the number of samples that are kept."""
        return len(self._old) + self._count

    def read(self) -> None:
        """Read the new samples. Call this often, because the channel keeps only the newest samples."""
        self._seen, rows = self._channel.since(self._seen)
        self.add(rows)

    def add(self, rows: Rows) -> None:
        """Append samples, at most `FULL_ROWS` at once."""
        if self._count + len(rows) > CAPACITY:
            self._reduce_oldest()
        self._rows[self._count : self._count + len(rows)] = rows
        self._count += len(rows)

    @property
    def ends_s(self) -> tuple[float, float]:
        """The times of the oldest and of the newest sample. Both are 0 without a sample."""
        if not self._count:
            return 0.0, 0.0
        oldest = self._old[0] if len(self._old) else self._rows[0]
        return float(oldest[_TIME]), float(self._rows[self._count - 1, _TIME])

    def window(self, from_s: float, to_s: float, most: int) -> Rows:
        """Return the samples from `from_s` to `to_s`, and the neighbouring sample at either end.

        If there are more than `most` samples, only some of them are returned (see `reduced`).
        """
        parts = [_between(rows, from_s, to_s) for rows in (self._old, self._rows[: self._count])]
        return reduced(np.concatenate(parts), most)

    def _reduce_oldest(self) -> None:
        """Reduce the oldest `FULL_ROWS` samples that are still complete, and append them to the reduced samples."""
        oldest = reduced(self._rows[:FULL_ROWS], FULL_ROWS // self._factor)
        self._old = np.concatenate((self._old, oldest))
        while len(self._old) > FULL_ROWS:
            self._old = reduced(self._old, len(self._old) // 2)
            self._factor *= 2
        self._rows[: self._count - FULL_ROWS] = self._rows[FULL_ROWS : self._count].copy()
        self._count -= FULL_ROWS


def _between(rows: Rows, from_s: float, to_s: float) -> Rows:
    first, last = np.searchsorted(rows[:, _TIME], (from_s, to_s))
    return rows[max(first - 1, 0) : last + 1]


def reduced(rows: Rows, most: int) -> Rows:
    """Return all rows if there are at most `most`, otherwise the rows with the extremes of short intervals.

    `most` is the largest number of rows to return. The extremes are those of temperature, displacement and current.
    """
    if len(rows) <= most:
        return rows
    intervals = max(most // (2 * len(EXTREMES_OF)), 1)
    edges = np.linspace(0, len(rows), intervals + 1).astype(np.intp)[:-1]
    sizes = np.diff([*edges, len(rows)])
    chosen = [_at_extreme(sign * rows[:, column], edges, sizes) for column in EXTREMES_OF for sign in (1.0, -1.0)]
    return rows[np.unique(np.concatenate(chosen))]


def _at_extreme(values: NDArray[np.float64], edges: NDArray[np.intp], sizes: NDArray[np.intp]) -> NDArray[np.intp]:
    """Return for each interval the index of its first largest value. NaN is never the largest.

    `edges` are the indices at which the intervals begin, `sizes` their lengths.
    """
    values = np.where(np.isfinite(values), values, -np.inf)
    largest = np.repeat(np.maximum.reduceat(values, edges), sizes)
    indices = np.where(values == largest, np.arange(values.size), values.size)
    return np.minimum.reduceat(indices, edges)
