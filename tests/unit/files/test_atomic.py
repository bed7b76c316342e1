"""A file is replaced completely or not at all; an input, a record or a special file is never replaced."""

import os
import socket
import stat
import subprocess
import sys

import pytest

from smadrive.errors import DataError
from smadrive.files.atomic import check_output, creating, replacing
from smadrive.files.kinds import LOG, MODEL, TABLE


def write(path, text="new"):
    with replacing(path) as partial:
        partial.write_text(text)


def names(folder):
    return sorted(entry.name for entry in folder.iterdir())


def test_new_file_has_the_permissions_of_the_umask(tmp_path):
    before = os.umask(0o027)
    try:
        write(tmp_path / "f")
    finally:
        os.umask(before)
    assert stat.S_IMODE((tmp_path / "f").stat().st_mode) == 0o640
    assert (tmp_path / "f").read_text() == "new"
    assert names(tmp_path) == ["f"]


def test_replaced_file_keeps_its_permissions(tmp_path):
    (tmp_path / "f").write_text("old")
    (tmp_path / "f").chmod(0o604)
    write(tmp_path / "f")
    assert stat.S_IMODE((tmp_path / "f").stat().st_mode) == 0o604
    assert (tmp_path / "f").read_text() == "new"


@pytest.mark.skipif(os.getuid() != 0, reason="only root may give a file away")
def test_replaced_file_keeps_its_owner(tmp_path):
    (tmp_path / "f").write_text("old")
    os.chown(tmp_path / "f", 1234, 4321)
    write(tmp_path / "f")
    found = (tmp_path / "f").stat()
    assert (found.st_uid, found.st_gid) == (1234, 4321)


def test_leftover_of_a_killed_process_with_the_same_number_blocks_nothing(tmp_path):
    (tmp_path / f".f.{os.getpid()}.partial").write_text("half")
    write(tmp_path / "f")
    assert (tmp_path / "f").read_text() == "new"


def test_old_file_stays_until_the_new_one_is_complete(tmp_path):
    (tmp_path / "f").write_text("old")
    with pytest.raises(ZeroDivisionError), replacing(tmp_path / "f") as partial:  # noqa: PT012
        partial.write_text("half")
        assert (tmp_path / "f").read_text() == "old"
        raise ZeroDivisionError
    assert (tmp_path / "f").read_text() == "old"
    assert names(tmp_path) == ["f"]


def test_target_of_a_link_is_replaced(tmp_path):
    (tmp_path / "far").mkdir()
    (tmp_path / "far" / "f").write_text("old")
    (tmp_path / "link").symlink_to(tmp_path / "far" / "f")
    write(tmp_path / "link")
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "far" / "f").read_text() == "new"
    assert names(tmp_path / "far") == ["f"]


def test_missing_target_of_a_link_is_created(tmp_path):
    (tmp_path / "link").symlink_to(tmp_path / "f")
    write(tmp_path / "link")
    assert (tmp_path / "f").read_text() == "new"


@pytest.mark.parametrize(
    ("make", "kind"),
    [
        (os.mkfifo, "a pipe"),
        (os.mkdir, "a folder"),
        (lambda path: socket.socket(socket.AF_UNIX).bind(str(path)), "a socket"),
    ],
)
@pytest.mark.parametrize("through_a_link", [False, True])
@pytest.mark.filterwarnings("ignore:unclosed:ResourceWarning")
def test_special_file_is_not_replaced(tmp_path, make, kind, through_a_link):
    make(tmp_path / "special")
    before = (tmp_path / "special").stat()
    path = tmp_path / "special"
    if through_a_link:
        path = tmp_path / "link"
        path.symlink_to(tmp_path / "special")
    with pytest.raises(DataError) as caught:
        write(path)
    assert caught.value.where == str(path)
    assert kind in caught.value.what
    assert (tmp_path / "special").stat().st_ino == before.st_ino
    assert not any("partial" in name for name in names(tmp_path))


@pytest.mark.skipif(os.getuid() == 0, reason="nothing is write-protected against root")
def test_write_protected_file_is_not_replaced(tmp_path):
    (tmp_path / "f").write_text("old")
    (tmp_path / "f").chmod(0o444)
    with pytest.raises(DataError) as caught:
        write(tmp_path / "f")
    assert caught.value.where == str(tmp_path / "f")
    assert (tmp_path / "f").read_text() == "old"


def test_missing_folder_and_circular_links_are_errors(tmp_path):
    (tmp_path / "a").symlink_to(tmp_path / "b")
    (tmp_path / "b").symlink_to(tmp_path / "a")
    for path in (tmp_path / "no" / "f", tmp_path / "a"):
        with pytest.raises(DataError) as caught:
            write(path)
        assert caught.value.where == str(path)


FULL = """
import resource, sys
from pathlib import Path
from smadrive.errors import DataError
from smadrive.files.atomic import replacing

resource.setrlimit(resource.RLIMIT_FSIZE, (100, 100))
try:
    with replacing(Path(sys.argv[1])) as partial:
        partial.write_text("x" * 1000)
except DataError as error:
    print(error)
"""


def test_full_disk_leaves_the_old_file(tmp_path):
    (tmp_path / "f").write_text("old")
    message = subprocess.run(
        [sys.executable, "-c", FULL, tmp_path / "f"], capture_output=True, text=True, check=True
    ).stdout
    assert "f: cannot be written: File too large" in message
    assert (tmp_path / "f").read_text() == "old"
    assert names(tmp_path) == ["f"]


@pytest.mark.parametrize("name", ["run.csv", "run", "run.toml", "run.h5.html"])
def test_ending_of_another_kind_is_an_error(tmp_path, name):
    with pytest.raises(DataError) as caught:
        check_output(tmp_path / name, LOG)
    assert caught.value.where == str(tmp_path / name)
    assert all(ending in caught.value.what for ending in LOG.endings)
    check_output(tmp_path / "run.H5", LOG)


def test_missing_folder_is_an_error_before_anything_is_computed(tmp_path):
    with pytest.raises(DataError) as caught:
        check_output(tmp_path / "no" / "f.json", MODEL)
    assert caught.value.where == str(tmp_path / "no" / "f.json")


def test_folder_at_the_path_is_an_error_before_anything_is_computed(tmp_path):
    (tmp_path / "f.json").mkdir()
    with pytest.raises(DataError) as caught:
        check_output(tmp_path / "f.json", MODEL)
    assert caught.value.where == str(tmp_path / "f.json")
    assert "a folder" in caught.value.what


@pytest.mark.parametrize("link", [os.symlink, os.link])
def test_input_is_not_overwritten_under_any_name(tmp_path, link):
    (tmp_path / "a.csv").write_text("data")
    link(tmp_path / "a.csv", tmp_path / "b.csv")
    for name in ("a.csv", "b.csv"):
        with pytest.raises(DataError) as caught:
            check_output(tmp_path / name, TABLE, tmp_path / "absent.json", tmp_path / "a.csv")
        assert caught.value.where == str(tmp_path / name)
        assert "input" in caught.value.what
    check_output(tmp_path / "c.csv", TABLE, tmp_path / "a.csv")


def test_record_is_never_overwritten_and_a_model_is(tmp_path):
    for name, kind in (("f.h5", LOG), ("f.json", MODEL)):
        check_output(tmp_path / name, kind)
        (tmp_path / name).write_text("old")
    check_output(tmp_path / "f.json", MODEL)
    (tmp_path / "dangling.h5").symlink_to(tmp_path / "nothing")
    for name in ("f.h5", "dangling.h5"):
        with pytest.raises(DataError) as caught:
            check_output(tmp_path / name, LOG)
        with pytest.raises(DataError) as caught_again, creating(tmp_path / name):
            pytest.fail("nothing may be written")
        assert caught.value.where == caught_again.value.where == str(tmp_path / name)
        assert caught.value.what == caught_again.value.what
    assert (tmp_path / "f.h5").read_text() == "old"


def test_failed_creation_leaves_no_file(tmp_path):
    with pytest.raises(ZeroDivisionError), creating(tmp_path / "f"):
        raise ZeroDivisionError
    assert names(tmp_path) == []
    with creating(tmp_path / "f") as partial:
        partial.write_text("new")
    assert (tmp_path / "f").read_text() == "new"
    assert names(tmp_path) == ["f"]


@pytest.fixture
def stranger():
    """Become a user who may not enter the folders of root, as root's test folders are."""
    os.seteuid(65534)
    yield
    os.seteuid(0)


LONG_NAME = "x" * 300


@pytest.mark.parametrize("kind", [LOG, MODEL])
def test_name_that_is_too_long_is_an_error_about_the_output(tmp_path, kind):
    path = tmp_path / f"{LONG_NAME}{kind.endings[0]}"
    with pytest.raises(DataError) as refused:
        check_output(path, kind, tmp_path / LONG_NAME)
    assert refused.value.where == str(path)


@pytest.mark.skipif(os.getuid() != 0, reason="only root may become another user")
@pytest.mark.parametrize("name", ["m.json", "folder/m.json"])
def test_closed_folder_is_an_error_about_the_output(tmp_path, stranger, name):
    for write_to in (lambda path: check_output(path, MODEL, path.with_name("l.h5")), write):
        with pytest.raises(DataError) as refused:
            write_to(tmp_path / name)
        assert refused.value.where == str(tmp_path / name)
