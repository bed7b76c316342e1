"""Output files: the check of their names, and writing that either completes or changes nothing.

The ending of an output's name must fit its content, and an output must not be an input of the same command. A log is
never overwritten, because its measurements cannot be repeated. Models, tables and pages can be made again, so they
replace an existing file. Commands call `check_output` before they heat or compute.

A reader sees the old file or the new one, never a part. The new content is written to a partial file in the same
folder, synchronized to the disk, and renamed. The partial file of a killed process stays, but blocks no later writing:
its name has a random part, because process numbers repeat in containers. A rename could also replace a device node, a
pipe or a socket, so only a regular file may be replaced. For anything else at the path, an error is raised before the
first byte is written. If the path is a link, the target of the link is replaced, and the link stays.
"""

from __future__ import annotations

import os
import secrets
import stat
from collections.abc import Collection, Iterator
from contextlib import contextmanager, suppress
from itertools import count
from pathlib import Path

from smadrive.errors import DataError
from smadrive.files.kinds import FileKind, irregular_kind

ANOTHER_NAME = "choose another name"


def check_output(path: Path, kind: FileKind, *inputs: Path) -> None:
    """Raise DataError when a command that reads `inputs` must not write a file of `kind` to `path`.

    The reasons are: a wrong ending of the name, `path` is one of the `inputs`, an existing record, a folder or another
    file that may not be replaced, or its folder does not exist or is closed.
    """
    if not kind.has_ending(path):
        endings = " or ".join(kind.endings)
        raise DataError(f"the name of {kind.what} ends in {endings}", where=path, cure=ANOTHER_NAME)
    for source in inputs:
        if os.path.exists(path) and os.path.exists(source) and path.samefile(source):
            raise DataError("is an input of this command, which would overwrite it", where=path, cure=ANOTHER_NAME)
    if kind.is_record and os.path.lexists(path):
        raise _exists(path)
    try:
        is_new = _replaceable(path) is None
    except OSError as error:
        raise _unwritable(path, error) from None
    if is_new and not path.parent.exists():
        raise _without_folder(path)


def unused_record(stem: str, kind: FileKind, reserved: Collection[Path] = ()) -> Path:
    """Return the first of STEM.h5, STEM-2.h5, STEM-3.h5, … that does not exist in the current folder.

    STEM is `stem`; the ending is the first ending of `kind`. `reserved` are absolute paths that are skipped, too.
    """
    paths = (Path(f"{stem}{'' if number == 1 else f'-{number}'}{kind.endings[0]}") for number in count(1))
    return next(path for path in paths if not os.path.lexists(path) and path.absolute() not in reserved)


@contextmanager
def creating(path: Path) -> Iterator[Path]:
    """Create the file `path`: yield a partial file to write, which becomes `path` at the end of the block.

    After an error in the `with` block no file remains. DataError when `path` exists or cannot be written.
    """
    try:
        os.close(os.open(path, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666))
    except FileExistsError:
        raise _exists(path) from None
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
    """Yield a partial file to write, which replaces `path` at the end of the block.

    After an error in the `with` block the partial file is removed, and `path` stays unchanged. The new file gets the
    permissions of the old file, and its owner if this is allowed. DataError when `path` may not be replaced or cannot
    be written.
    """
    try:
        before = _replaceable(path)
        target = path.resolve()
        partial = target.with_name(f".{target.name}.{secrets.token_hex(4)}.partial")
        os.close(os.open(partial, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666))
    except OSError as error:
        raise _unwritable(path, error) from None
    try:
        yield partial
        if before is not None:
            _copy_permissions(before, partial)
        _to_disk(partial)
        partial.replace(target)
        _to_disk(target.parent)
    except OSError as error:
        raise _unwritable(path, error) from None
    finally:
        partial.unlink(missing_ok=True)


def _replaceable(path: Path) -> os.stat_result | None:
    """Return the status of the file at `path`, or None if there is no file. DataError if it may not be replaced."""
    try:
        found = path.stat()
    except FileNotFoundError:
        return None
    if kind := irregular_kind(found):
        raise DataError(f"cannot be written: it is {kind}, not a regular file", where=path, cure=ANOTHER_NAME)
    if not os.access(path, os.W_OK):
        raise DataError("cannot be written: it is write-protected", where=path, cure=f"{ANOTHER_NAME} or allow writing")
    return found


def _copy_permissions(before: os.stat_result, partial: Path) -> None:
    with suppress(PermissionError):
        os.chown(partial, before.st_uid, before.st_gid)
    partial.chmod(stat.S_IMODE(before.st_mode))


def _to_disk(path: Path) -> None:
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def _exists(path: Path) -> DataError:
    return DataError("exists, and a record is never overwritten", where=path, cure=f"{ANOTHER_NAME}, or move it away")


def _without_folder(path: Path) -> DataError:
    return DataError("cannot be written: its folder does not exist", where=path, cure=f"create {path.parent} first")


def _unwritable(path: Path, error: OSError) -> DataError:
    if isinstance(error, FileNotFoundError) and not path.parent.exists():
        return _without_folder(path)
    return DataError(
        f"cannot be written: {error.strerror or error}", where=path, cure="check the folder and its free space"
    )
