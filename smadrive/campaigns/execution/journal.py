"""The journal of a campaign: one line for each finished run, in the output folder. A later command can go on with it.

The first line identifies the plan, and the versions of the packages that compute the runs. Each further line is a JSON
object with the number of a run, its row and its effort. A line is written as soon as its run is finished. A kill can
cut the last line, and a disk can damage any. The first damaged line and all lines after it are removed when the journal
is opened again, and their runs are repeated. A failure that is not final has no line, so its run is repeated, too.
"""

from __future__ import annotations

import fcntl
import os
import time
from contextlib import suppress
from io import FileIO
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from smadrive.campaigns.experiments.run import Effort, RunResult
from smadrive.campaigns.plan.plan import CampaignPlan
from smadrive.campaigns.versions import versions
from smadrive.errors import DataError
from smadrive.files.checked_line import checked_line, fields_of_line

JOURNAL = "journal.jsonl"
SCHEMA = 1
SYNCED_S = 1.0
"""Shortest time between two synchronizations of the journal to the disk, s."""


class Journal:
    """The finished runs of a campaign by number, in memory and on the disk.

    A context manager. In its `with` block, no other command may use the folder.
    """

    def __init__(self, folder: Path, plan: CampaignPlan, *, resume: bool) -> None:
        self.folder, self._plan, self._resume = folder, plan, resume
        self.results: dict[int, RunResult] = {}
        self._end = 0

    def __enter__(self) -> Self:
        """Create the journal or, with `resume`, open the journal of an earlier command.

        DataError when another command uses the folder; without `resume`, when the folder is not empty; with `resume`,
        when the folder has no journal of this campaign, or other versions of the packages began it.
        """
        self._file = self._open()
        try:
            self._lock()
            if self._resume:
                self._read()
            else:
                head = {"schema": SCHEMA, "fingerprint": self._plan.fingerprint, "title": self._plan.config.title}
                self._write({**head, "versions": versions()})
        except BaseException:
            self._file.close()
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Synchronize the journal to the disk, and release the folder.

        A new journal without a run is removed, with the folder if this journal created it.
        """
        if not self.results and not self._resume:
            (self.folder / JOURNAL).unlink()
            if self._is_new_folder:
                with suppress(OSError):  # another file is in the folder
                    self.folder.rmdir()
        self._sync()
        self._file.close()

    def add(self, number: int, result: RunResult) -> None:
        """Add the result of a run to `results` and, if it is final, to the file.

        DataError when the file cannot be written.
        """
        if result.is_final:
            self._write({"run": number, "row": result.row, "effort": result.effort._asdict()})
        self.results[number] = result
        if time.monotonic() - self._synced_s > SYNCED_S:
            self._sync()

    @property
    def not_final(self) -> int:
        """The number of runs in `results` that `--resume` repeats."""
        return sum(not result.is_final for result in self.results.values())

    def _open(self) -> FileIO:
        path = self.folder / JOURNAL
        self._is_new_folder = not self.folder.exists()
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            if self._resume:
                return FileIO(path, "r+")
            _check_empty(self.folder)
            return FileIO(path, "x")
        except FileNotFoundError:
            cure = "give the folder of an interrupted campaign, or leave out --resume"
            raise DataError("no campaign was begun in this folder", where=self.folder, cure=cure) from None
        except FileExistsError:
            raise _not_empty(self.folder) from None
        except OSError as error:
            cure = "choose another folder"
            raise DataError("cannot be used as a folder", where=self.folder, value=error.strerror, cure=cure) from None

    def _lock(self) -> None:
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            cure = "wait until it has ended, or choose another folder"
            raise DataError("another campaign writes into this folder", where=self.folder, cure=cure) from None

    def _read(self) -> None:
        """Read the finished runs, and remove the lines from the first damaged one on."""
        head, *lines = self._file.readall().splitlines(keepends=True) or [b""]
        self._check_head(head)
        self._end = len(head)
        for line in lines:
            try:
                entry = fields_of_line(line if line.endswith(b"\n") else b"")
            except ValueError:
                break
            self.results[entry["run"]] = RunResult(entry["row"], Effort(**entry["effort"]))
            self._end += len(line)
        self._file.truncate(self._end)
        self._file.seek(self._end)
        self._sync()

    def _check_head(self, line: bytes) -> None:
        try:
            entry = fields_of_line(line if line.endswith(b"\n") else b"")
        except ValueError:
            cure = "choose another folder"
            raise DataError(
                "the first line of the journal is damaged", where=self.folder / JOURNAL, cure=cure
            ) from None
        if entry.get("fingerprint") != self._plan.fingerprint:
            raise DataError(
                "the folder belongs to another campaign, or a file that the campaign names has changed",
                where=self.folder,
                value=entry.get("title"),
                cure="give the same campaign file with the same files, or choose another folder without --resume",
            )
        if (found := entry.get("versions")) != (own := versions()):
            raise DataError(
                "other versions of the packages began this campaign, so its runs may differ",
                where=self.folder,
                value=_joined(found),
                limit=_joined(own),
                cure="install the same versions, or choose another folder without --resume",
            )

    def _write(self, entry: dict[str, Any]) -> None:
        line = checked_line(entry)
        written = 0
        try:
            while written < len(line):  # the last bytes of a full disk take a part of the line
                written += self._file.write(line[written:])
        except OSError as error:
            self._file.truncate(self._end)
            cure = "make room on the disk, and go on with --resume"
            raise DataError("cannot be written", where=self.folder, value=error.strerror, cure=cure) from None
        self._end += len(line)
        self._synced_s = getattr(self, "_synced_s", time.monotonic())

    def _sync(self) -> None:
        os.fsync(self._file.fileno())
        self._synced_s = time.monotonic()


def _joined(packages: dict[str, str] | None) -> str:
    return ", ".join(f"{name} {number}" for name, number in (packages or {}).items()) or "unknown"


def _check_empty(folder: Path) -> None:
    if any(folder.iterdir()):
        raise _not_empty(folder)


def _not_empty(folder: Path) -> DataError:
    cure = "choose another folder, or go on with the campaign in this folder: --resume"
    return DataError("the folder is not empty", where=folder, cure=cure)
