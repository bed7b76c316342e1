"""A file is known by what is in it, and one of another kind than was wanted is called by its own."""

import os
from pathlib import Path

import pytest

from smadrive.errors import DataError, ModelError
from smadrive.files.kinds import CONFIGS, LOG, MODEL, PROFILE, TABLE, check_kind
from smadrive.files.shipped import configs_dir

SHIPPED = [(path, kind) for kind in CONFIGS if kind.folder for path in (configs_dir() / kind.folder).glob("*.toml")]


@pytest.mark.parametrize(("path", "own"), SHIPPED, ids=lambda value: getattr(value, "stem", None))
def test_every_shipped_file_is_of_its_own_kind_and_of_no_other(path, own):
    check_kind(path, own)
    for other in set(CONFIGS) - {own}:
        with pytest.raises(other.error, match=f"is {own.what}, and {other.what} is wanted here"):
            check_kind(path, other)


@pytest.mark.parametrize(
    ("content", "wanted", "error", "told"),
    [
        (b"\x89HDF\r\n\x1a\n...", MODEL, ModelError, r"is a log, and a model file is wanted here: give one \(.json\)"),
        (b"\xef\xbb\xbftime_s,x\n0,1\n", LOG, DataError, r"is a table \(CSV\), and a log is wanted here"),
        (b"<!DOCTYPE html><html>", LOG, DataError, r"is a page \(HTML\)"),
        (b'{"schema": 1, "kind": "duhem", "input_range": []}', TABLE, DataError, "is a model file"),
    ],
)
def test_another_kind_is_told_by_its_name(tmp_path, content, wanted, error, told):
    path = tmp_path / "file"
    path.write_bytes(content)
    with pytest.raises(error, match=told) as caught:
        check_kind(path, wanted)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("content", [b"", b"# Notes\n", b"{", b"[limits]\n", b"a,b\nc,d\n", b"\x00\xff"])
def test_what_is_of_no_known_kind_is_left_to_its_reader(tmp_path, content):
    path = tmp_path / "file"
    path.write_bytes(content)
    check_kind(path, PROFILE)
    check_kind(tmp_path / "absent", PROFILE)


@pytest.mark.parametrize("wanted", [PROFILE, MODEL, TABLE, LOG])
def test_what_is_no_regular_file_is_called_by_what_it_is_and_never_opened(tmp_path, wanted):
    pipe, folder = tmp_path / "pipe", tmp_path / "folder"
    os.mkfifo(pipe)
    folder.mkdir()
    for path, told in ((pipe, "a pipe"), (folder, "a folder"), (Path("/dev/zero"), "a device")):
        with pytest.raises(wanted.error, match=f"{path}: is {told}, no regular file"):
            check_kind(path, wanted)


@pytest.mark.parametrize("content", ["a = " + "[" * 100_000, '{"a": ' + "[" * 100_000])
def test_what_is_nested_too_deeply_is_of_no_known_kind(tmp_path, content):
    path = tmp_path / "file"
    path.write_text(content)
    check_kind(path, PROFILE)
