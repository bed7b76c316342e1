"""The kind of a file is recognized by its content; an error names the kind that was found and the expected one."""

import os
from pathlib import Path

import pytest

from smadrive.errors import DataError, ModelError
from smadrive.files.kinds import CONFIGS, LOG, MODEL, PAGE, PROFILE, TABLE, check_kind
from smadrive.files.shipped import configs_dir

SHIPPED = [(path, kind) for kind in CONFIGS if kind.folder for path in (configs_dir() / kind.folder).glob("*.toml")]


@pytest.mark.parametrize(("path", "own"), SHIPPED, ids=lambda value: getattr(value, "stem", None))
def test_shipped_file_is_of_its_own_kind_and_no_other(path, own):
    check_kind(path, own)
    for other in set(CONFIGS) - {own}:
        with pytest.raises(other.error) as caught:
            check_kind(path, other)
        assert (caught.value.where, caught.value.cure) == (str(path), other.cure)
        assert own.what in caught.value.what
        assert other.what in caught.value.what


@pytest.mark.parametrize(
    ("content", "expected", "error", "kind"),
    [
        (b"\x89HDF\r\n\x1a\n...", MODEL, ModelError, LOG),
        (b"\xef\xbb\xbftime_s,x\n0,1\n", LOG, DataError, TABLE),
        (b"<!DOCTYPE html><html>", LOG, DataError, PAGE),
        (b'{"schema": 1, "kind": "duhem", "input_range": []}', TABLE, DataError, MODEL),
    ],
)
def test_another_kind_is_named(tmp_path, content, expected, error, kind):
    path = tmp_path / "file"
    path.write_bytes(content)
    with pytest.raises(error) as caught:
        check_kind(path, expected)
    assert (caught.value.where, caught.value.cure) == (str(path), expected.cure)
    assert kind.what in caught.value.what
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("content", [b"", b"# Notes\n", b"{", b"[limits]\n", b"a,b\nc,d\n", b"\x00\xff"])
def test_unknown_kind_is_left_to_the_reader(tmp_path, content):
    path = tmp_path / "file"
    path.write_bytes(content)
    check_kind(path, PROFILE)
    check_kind(tmp_path / "absent", PROFILE)


@pytest.mark.parametrize("expected", [PROFILE, MODEL, TABLE, LOG])
def test_special_file_is_named_and_never_opened(tmp_path, expected):
    pipe, folder = tmp_path / "pipe", tmp_path / "folder"
    os.mkfifo(pipe)
    folder.mkdir()
    for path, kind in ((pipe, "a pipe"), (folder, "a folder"), (Path("/dev/zero"), "a device")):
        with pytest.raises(expected.error) as caught:
            check_kind(path, expected)
        assert caught.value.where == str(path)
        assert kind in caught.value.what


@pytest.mark.parametrize("content", ["a = " + "[" * 100_000, '{"a": ' + "[" * 100_000])
def test_file_that_is_nested_too_deeply_is_of_unknown_kind(tmp_path, content):
    path = tmp_path / "file"
    path.write_text(content)
    check_kind(path, PROFILE)
