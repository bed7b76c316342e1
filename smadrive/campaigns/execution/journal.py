"""The journal of a campaign: one line for each finished run, in the output folder. A later command can go on with it.

The first line identifies the plan, without its report, and the versions of the packages that decide the table. Each
further line is a JSON object with the number of a run, its row and its effort. A line is written as soon as its run is
finished. A kill can cut the last line, and a disk can damage any. The first damaged line and all lines after it are
removed when the journal is opened again, and their runs are repeated. A failure that is not final has no line, so its
run is repeated, too.

A copy of the campaign file is written before the first line, because only the same settings can go on with the runs.
"""

from __future__ import annotations

import errno
import os
import time
from contextlib import ExitStack, suppress
from io import FileIO
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from smadrive.campaigns.experiments.run import Effort, RunResult
from smadrive.campaigns.plan.plan import CampaignPlan
from smadrive.campaigns.versions import table_versions
from smadrive.errors import DataError
from smadrive.files.atomic import replacing
from smadrive.files.checked_line import checked_line, fields_of_line
from smadrive.posix import fcntl

JOURNAL, COPY = "journal.jsonl", "campaign.toml"
SCHEMA = 4
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
        self._has_begun = resume

    def __enter__(self) -> Self:
        """Create the journal or, with `resume`, open the journal of an earlier command.

        DataError when another command uses the folder; without `resume`, when the folder is not empty; with `resume`,
        when the folder has no journal of this campaign, or other versions of the packages began it; and when the disk
        is full. After an error, no new file is left.
        """
        with ExitStack() as stack:
            self._file = stack.enter_context(self._open())
            self._lock()
            stack.callback(self._remove_unless_begun)
            if not (self._resume and self._read()):
                self._write_copy()
                self._write(self._head())
            self._sync()
            self._on_exit = stack.pop_all()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Synchronize the journal to the disk, and release the folder. DataError when the disk fails.

        A new journal without a finished run is removed with its copy of the campaign file, and with the folder if this
        journal created it.
        """
        with self._on_exit:
            try:
                self._sync()
            except DataError:
                if error is None:  # otherwise the user reads the error that ended the block
                    raise

    def _remove_unless_begun(self) -> None:
        if self._has_begun:
            return
        (self.folder / JOURNAL).unlink()
        (self.folder / COPY).unlink(missing_ok=True)
        if self._is_new_folder:
            with suppress(OSError):  # another file is in the folder
                self.folder.rmdir()

    def add(self, number: int, result: RunResult) -> None:
        """Add the result of a run to `results` and, if it is final, to the file.

        DataError when the file cannot be written.
        """
        self._has_begun = True
        if result.is_final:
            self._write({"run": number, "row": result.row, "effort": result.effort._asdict()})
        self.results[number] = result
        if time.monotonic() - self._synced_s > SYNCED_S:
            self._sync()

    @property
    def not_final(self) -> int:
        """The number of runs in `results` that `--resume` repeats."""
        return sum(not result.is_final for result in self.results.values())

    def _head(self) -> dict[str, Any]:
        """Return the fields of the first line."""
        head = {"schema": SCHEMA, "fingerprint": self._plan.fingerprint, "title": self._plan.config.title}
        return {**head, "versions": table_versions()}

    def _open(self) -> FileIO:
        path = self.folder / JOURNAL
        self._is_new_folder = not os.path.exists(self.folder)
        try:
            if self._resume:
                return FileIO(path, "r+")
            self.folder.mkdir(parents=True, exist_ok=True)
            _check_empty(self.folder)
            return FileIO(path, "x")
        except FileNotFoundError:
            cure = "give the folder of an interrupted campaign, or leave out --resume"
            raise DataError("no campaign was begun in this folder", where=self.folder, cure=cure) from None
        except FileExistsError:
            if self.folder.is_dir():  # another command was faster
                raise _not_empty(self.folder) from None
            raise _unusable(self.folder, os.strerror(errno.ENOTDIR)) from None
        except OSError as error:
            raise _unusable(self.folder, error.strerror) from None

    def _lock(self) -> None:
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            cure = "wait until it has ended, or choose another folder"
            raise DataError("another campaign writes into this folder", where=self.folder, cure=cure) from None

    def _read(self) -> bool:
        """Read the finished runs, and remove the lines from the first damaged one on.

        Return False if the first line has no end, because a kill or a full disk cut it: then no run is finished.
        DataError for another text without an end, because the file may belong to another program, and for a copy of
        another campaign file.
        """
        head, *lines = self._file.readall().splitlines(keepends=True) or [b""]
        is_begun = head.endswith(b"\n")
        if is_begun:
            self._check_head(head)
            self._read_runs(head, lines)
        elif not checked_line(self._head()).startswith(head):
            raise self._damaged_head()
        elif (copy := self.folder / COPY).exists() and copy.read_bytes() != self._plan.text.encode():
            raise self._of_another_campaign(COPY)
        self._file.truncate(self._end)
        self._file.seek(self._end)
        return is_begun

    def _read_runs(self, head: bytes, lines: list[bytes]) -> None:
        self._end = len(head)
        for line in lines:
            try:
                entry = fields_of_line(line if line.endswith(b"\n") else b"")
            except ValueError:
                break
            self.results[entry["run"]] = RunResult(entry["row"], Effort(**entry["effort"]))
            self._end += len(line)

    def _check_head(self, line: bytes) -> None:
        try:
            entry = fields_of_line(line)
        except ValueError:
            raise self._damaged_head() from None
        if (schema := entry.get("schema")) != SCHEMA:
            raise DataError(
                "another version of smadrive wrote the journal",
                where=self.folder / JOURNAL,
                value=f"schema {schema}",
                limit=SCHEMA,
                cure="go on with that version, or choose another folder without --resume",
            )
        if entry.get("fingerprint") != self._plan.fingerprint:
            raise self._of_another_campaign(entry.get("title"))
        if (found := entry.get("versions")) != (own := table_versions()):
            raise DataError(
                "other versions of the packages began this campaign, so its runs may differ",
                where=self.folder,
                value=_joined(found),
                limit=_joined(own),
                cure="install the same versions, or choose another folder without --resume",
            )

    def _of_another_campaign(self, value: str | None) -> DataError:
        return DataError(
            "the folder belongs to another campaign, or a file that the campaign names has changed",
            where=self.folder,
            value=value,
            cure=f"give the same campaign file, of which {COPY} in the folder is a copy, with the same files; or "
            "choose another folder without --resume",
        )

    def _damaged_head(self) -> DataError:
        what = "the first line is damaged, or not that of the journal of this campaign"
        return DataError(what, where=self.folder / JOURNAL, cure="choose another folder without --resume")

    def _write_copy(self) -> None:
        with replacing(self.folder / COPY) as partial:
            partial.write_text(self._plan.text, encoding="utf-8")

    def _write(self, entry: dict[str, Any]) -> None:
        line = checked_line(entry)
        written = 0
        try:
            while written < len(line):  # the last bytes of a full disk take a part of the line
                written += self._file.write(line[written:])
        except OSError as error:
            self._file.truncate(self._end)
            raise self._unwritable(error) from None
        self._end += len(line)

    def _sync(self) -> None:
        try:
            os.fsync(self._file.fileno())
        except OSError as error:
            raise self._unwritable(error) from None
        self._synced_s = time.monotonic()

    def _unwritable(self, error: OSError) -> DataError:
        cure = f"make room on the disk, and {'go on with --resume' if self._has_begun else 'start again'}"
        return DataError("cannot be written", where=self.folder, value=error.strerror, cure=cure)


def _joined(packages: dict[str, str] | None) -> str:
    return ", ".join(f"{name} {number}" for name, number in (packages or {}).items()) or "unknown"


def _check_empty(folder: Path) -> None:
    if any(folder.iterdir()):
        raise _not_empty(folder)


def _not_empty(folder: Path) -> DataError:
    cure = "choose another folder, or go on with the campaign in this folder: --resume"
    return DataError("the folder is not empty", where=folder, cure=cure)


def _unusable(folder: Path, reason: str | None) -> DataError:
    return DataError("cannot be used as a folder", where=folder, value=reason, cure="choose another folder")
