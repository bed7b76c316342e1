"""The files of a campaign: all its runs have the content that the files had at the start of the command.

The plan reads each rig, simulated wire and data sheet once. A worker reads models, records, references and profiles
itself, so every run carries the digests of these files, and the worker compares them.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from io import BufferedReader
from pathlib import Path
from typing import NamedTuple, TypeVar

from smadrive.errors import ConfigError, DataError
from smadrive.files.config import read_toml
from smadrive.files.kinds import PROFILE
from smadrive.files.shipped import config_file
from smadrive.rig.planned_device import profile_text
from smadrive.wire.data_sheet import load_data_sheet

ResultT = TypeVar("ResultT")

SHOWN_DIGITS = 12
"""Number of digits of a digest in an error."""


class ChangedFileError(DataError):
    """A file has not the content that it had at the start of the campaign, or this machine cannot read it."""


class RunFile(NamedTuple):
    """A file that a worker reads: its absolute path or the name of a shipped profile, and its SHA-256 digest."""

    name: str
    digest: str

    @property
    def path(self) -> Path:
        """The path of the file on this machine. ConfigError for an unknown profile."""
        return Path(self.name) if Path(self.name).is_absolute() else config_file(self.name, PROFILE)


class CampaignFiles:
    """The files of a campaign by path or name. Each is read once: a later change of the file does not count.

    Every method raises ConfigError for a file that is missing or wrong.
    """

    def __init__(self) -> None:
        self.toml = cache(read_toml)
        self.data_sheet = cache(load_data_sheet)
        self.profile_text = cache(profile_text)
        self.run_file = cache(_run_file)

    def profile(self, name: str) -> RunFile:
        """Return the file of a profile. `name` is a path or the name of a shipped profile, with or without variant."""
        return self.run_file(name.partition(":")[0])


def of_unchanged_files(files: Sequence[RunFile], task: Callable[[], ResultT]) -> ResultT:
    """Return `task()`, which reads `files`. ChangedFileError, also in place of an error of the task, if one changed.

    The files are compared before the task, because it may take long, and after it, because they may change meanwhile.
    """
    _check_unchanged(files)
    try:
        return task()
    finally:
        _check_unchanged(files)


def _check_unchanged(files: Sequence[RunFile]) -> None:
    cure = "restore the file, on every worker, and go on with --resume"
    for file in files:
        try:
            found = content_digest(file.path)
        except ConfigError as error:
            raise ChangedFileError("cannot be read any more", where=error.where, value=error.value, cure=cure) from None
        if found != file.digest:
            value, limit = (f"SHA-256 {digest[:SHOWN_DIGITS]}" for digest in (found, file.digest))
            what = "the content is not that at the start of the campaign"
            raise ChangedFileError(what, where=file.path, value=value, limit=limit, cure=cure)


def content_digest(path: Path) -> str:
    """Return the SHA-256 digest of a file. ConfigError if it cannot be read."""
    with opened(path) as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


@contextmanager
def opened(path: Path) -> Iterator[BufferedReader]:
    """Yield the file at `path`, opened for reading. ConfigError if it cannot be read."""
    try:
        with path.open("rb") as file:
            yield file
    except OSError as error:
        raise ConfigError("cannot be read", where=path, value=error.strerror, cure="check the path") from None
    except ValueError as error:  # a null character in the path
        raise ConfigError("cannot be read", where=ascii(str(path)), value=str(error), cure="check the path") from None


def check_name(path: Path) -> None:
    """Raise ConfigError for a name that is no text in UTF-8: the table and the report could not hold it."""
    try:
        str(path).encode()
    except UnicodeEncodeError:
        cure = "rename the file or its folder"
        raise ConfigError("the name is not UTF-8", where=ascii(str(path)), cure=cure) from None


def _run_file(name: str) -> RunFile:
    return RunFile(name, content_digest(RunFile(name, "").path))
