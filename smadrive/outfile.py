"""Writing a file completely or not at all: whoever reads it sees the old one or the new one, never half of one.

The new content grows in a partial file beside its place and takes that place by one rename, once it is safely on the
disk. A rename takes the place of whatever bears the name, so only a regular file may be replaced: a device node, a
pipe, a socket or a folder is refused before anything is written. A link keeps pointing, its target is replaced.
"""

from __future__ import annotations

import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from smadrive.errors import DataError

_KINDS = {
    stat.S_IFDIR: "a folder",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
    stat.S_IFIFO: "a pipe",
    stat.S_IFSOCK: "a socket",
}


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
    if not stat.S_ISREG(found.st_mode):
        kind = _KINDS.get(stat.S_IFMT(found.st_mode), "no regular file")
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


def _unwritable(path: Path, error: OSError) -> DataError:
    return DataError(f"{path}: cannot be written ({error.strerror or error}): check the folder and its space")
