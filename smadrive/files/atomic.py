"""What a command writes: where it may, and how a file is written completely or not at all.

The end of an output's name tells what it holds, an output is never one of the files that the command reads, and a log,
the record of what cannot be made again, is never written over. Models, tables and pages are made from other files and
can be made again: they replace the one that was there. Commands ask `check_output` before they heat or compute.

Whoever reads a file sees the old one or the new one, never half of one. The new content grows in a partial file beside
its place and takes that place by one rename, once it is safely on the disk. A rename takes the place of whatever bears
the name, so only a regular file may be replaced: a device node, a pipe, a socket or a folder is refused before anything
is written. A link keeps pointing, its target is replaced.
"""

from __future__ import annotations

import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from smadrive.errors import DataError
from smadrive.files.kinds import irregular_kind


@dataclass(frozen=True)
class Form:
    """What a file holds and how its name ends; of a record there is only the one."""

    what: str
    endings: tuple[str, ...]
    is_record: bool = False

    def names(self, path: Path) -> bool:
        """Whether the name is that of such a file."""
        return path.suffix.lower() in self.endings


LOG = Form("a log", (".h5", ".hdf5", ".nxs"), is_record=True)
MODEL = Form("a model", (".json",))
TABLE = Form("a table", (".csv",))
PAGE = Form("a page", (".html", ".htm"))


def check_output(path: Path, form: Form, *inputs: Path) -> None:
    """Whether a command that reads `inputs` may write `form` to `path`. DataError names what stands against it."""
    if not form.names(path):
        endings = " or ".join(form.endings)
        raise DataError(f"{path}: {form.what} goes here, and its name ends in {endings}: choose another name")
    for source in inputs:
        if path.exists() and source.exists() and path.samefile(source):
            raise DataError(f"{path}: is read by this command, which would write over it: choose another name")
    if form.is_record and os.path.lexists(path):
        raise _taken(path)


@contextmanager
def creating(path: Path) -> Iterator[Path]:
    """As `replacing`, of a file that may not exist yet: DataError when it does."""
    try:
        os.close(os.open(path, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666))
    except FileExistsError:
        raise _taken(path) from None
    except OSError as error:
        raise _unwritable(path, error) from None
    try:
        with replacing(path) as partial:
            yield partial
    except BaseException:
        path.unlink(missing_ok=True)
        raise


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """The partial file to write; when the block ends it takes the place of `path`, when it raises it is removed.

    A replaced file keeps its permissions and, where allowed, its owner. DataError names what is at `path` when that may
    not be replaced, and what went wrong when it cannot be written.
    """
    try:
        before = _replaceable(path)
        target = path.resolve()
        partial = target.with_name(f".{target.name}.{os.getpid()}.partial")
        os.close(os.open(partial, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666))
    except OSError as error:
        raise _unwritable(path, error) from None
    try:
        yield partial
        if before is not None:
            _dress_like(before, partial)
        _to_disk(partial)
        partial.replace(target)
        _to_disk(target.parent)
    except OSError as error:
        raise _unwritable(path, error) from None
    finally:
        partial.unlink(missing_ok=True)


def _replaceable(path: Path) -> os.stat_result | None:
    """What is known of the file that stands at `path`; None when nothing does."""
    try:
        found = path.stat()
    except FileNotFoundError:
        return None
    if kind := irregular_kind(found):
        raise DataError(f"{path}: cannot be written: it is {kind}, which a file must not replace: choose another name")
    if not os.access(path, os.W_OK):
        raise DataError(f"{path}: cannot be written: it is write-protected: choose another name or allow writing")
    return found


def _dress_like(before: os.stat_result, partial: Path) -> None:
    with suppress(PermissionError):
        os.chown(partial, before.st_uid, before.st_gid)
    partial.chmod(stat.S_IMODE(before.st_mode))


def _to_disk(path: Path) -> None:
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def _taken(path: Path) -> DataError:
    return DataError(f"{path}: exists, and a record is never written over: choose another name, or move it away")


def _unwritable(path: Path, error: OSError) -> DataError:
    return DataError(f"{path}: cannot be written ({error.strerror or error}): check the folder and its space")
