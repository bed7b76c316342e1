"""A file is replaced completely or not at all, nothing but a file is ever replaced, and no input and no record."""

import os
import socket
import stat
import subprocess
import sys

import pytest

from smadrive.errors import DataError
from smadrive.files.atomic import LOG, MODEL, TABLE, check_output, creating, replacing


def write(path, text="new"):
    with replacing(path) as partial:
        partial.write_text(text)


def names(folder):
    return sorted(entry.name for entry in folder.iterdir())


def test_a_new_file_gets_what_the_umask_leaves(tmp_path):
    before = os.umask(0o027)
    try:
        write(tmp_path / "f")
    finally:
        os.umask(before)
    assert stat.S_IMODE((tmp_path / "f").stat().st_mode) == 0o640
    assert (tmp_path / "f").read_text() == "new"
    assert names(tmp_path) == ["f"]


def test_a_replaced_file_keeps_its_permissions(tmp_path):
    (tmp_path / "f").write_text("old")
    (tmp_path / "f").chmod(0o604)
    write(tmp_path / "f")
    assert stat.S_IMODE((tmp_path / "f").stat().st_mode) == 0o604
    assert (tmp_path / "f").read_text() == "new"


@pytest.mark.skipif(os.getuid() != 0, reason="only root may give a file away")
def test_a_replaced_file_keeps_its_owner(tmp_path):
    (tmp_path / "f").write_text("old")
    os.chown(tmp_path / "f", 1234, 4321)
    write(tmp_path / "f")
    found = (tmp_path / "f").stat()
    assert (found.st_uid, found.st_gid) == (1234, 4321)


def test_the_old_file_stands_until_the_new_one_is_complete(tmp_path):
    (tmp_path / "f").write_text("old")
    with pytest.raises(ZeroDivisionError), replacing(tmp_path / "f") as partial:  # noqa: PT012
        partial.write_text("half")
        assert (tmp_path / "f").read_text() == "old"
        raise ZeroDivisionError
    assert (tmp_path / "f").read_text() == "old"
    assert names(tmp_path) == ["f"]


def test_a_link_keeps_pointing_and_its_target_is_replaced(tmp_path):
    (tmp_path / "far").mkdir()
    (tmp_path / "far" / "f").write_text("old")
    (tmp_path / "link").symlink_to(tmp_path / "far" / "f")
    write(tmp_path / "link")
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "far" / "f").read_text() == "new"
    assert names(tmp_path / "far") == ["f"]


def test_a_link_to_nothing_makes_its_target(tmp_path):
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
def test_what_is_no_file_is_refused_and_stays(tmp_path, make, kind, through_a_link):
    make(tmp_path / "special")
    before = (tmp_path / "special").stat()
    path = tmp_path / "special"
    if through_a_link:
        path = tmp_path / "link"
        path.symlink_to(tmp_path / "special")
    with pytest.raises(DataError, match=f"{path}: cannot be written: it is {kind}"):
        write(path)
    assert (tmp_path / "special").stat().st_ino == before.st_ino
    assert not any("partial" in name for name in names(tmp_path))


@pytest.mark.skipif(os.getuid() == 0, reason="nothing is write-protected against root")
def test_a_write_protected_file_is_refused(tmp_path):
    (tmp_path / "f").write_text("old")
    (tmp_path / "f").chmod(0o444)
    with pytest.raises(DataError, match="write-protected"):
        write(tmp_path / "f")


def test_a_missing_folder_and_links_in_a_circle_are_told(tmp_path):
    with pytest.raises(DataError, match="No such file or directory"):
        write(tmp_path / "no" / "f")
    (tmp_path / "a").symlink_to(tmp_path / "b")
    (tmp_path / "b").symlink_to(tmp_path / "a")
    with pytest.raises(DataError, match="symbolic links"):
        write(tmp_path / "a")


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


def test_a_disk_that_takes_no_more_leaves_the_old_file(tmp_path):
    (tmp_path / "f").write_text("old")
    told = subprocess.run(
        [sys.executable, "-c", FULL, tmp_path / "f"], capture_output=True, text=True, check=True
    ).stdout
    assert "f: cannot be written (File too large): check the folder and its space" in told
    assert (tmp_path / "f").read_text() == "old"
    assert names(tmp_path) == ["f"]


@pytest.mark.parametrize("name", ["run.csv", "run", "run.toml", "run.h5.html"])
def test_a_name_that_tells_of_another_content_is_refused(tmp_path, name):
    with pytest.raises(DataError, match=r"its name ends in \.h5 or \.hdf5 or \.nxs: choose another name"):
        check_output(tmp_path / name, LOG)
    check_output(tmp_path / "run.H5", LOG)


@pytest.mark.parametrize("link", [os.symlink, os.link])
def test_an_input_is_no_output_by_whatever_name(tmp_path, link):
    (tmp_path / "a.csv").write_text("data")
    link(tmp_path / "a.csv", tmp_path / "b.csv")
    for name in ("a.csv", "b.csv"):
        with pytest.raises(DataError, match=f"{name}: is read by this command"):
            check_output(tmp_path / name, TABLE, tmp_path / "absent.json", tmp_path / "a.csv")
    check_output(tmp_path / "c.csv", TABLE, tmp_path / "a.csv")


def test_a_record_is_never_written_over_and_a_model_is(tmp_path):
    for name, form in (("f.h5", LOG), ("f.json", MODEL)):
        check_output(tmp_path / name, form)
        (tmp_path / name).write_text("old")
    check_output(tmp_path / "f.json", MODEL)
    (tmp_path / "dangling.h5").symlink_to(tmp_path / "nothing")
    for name in ("f.h5", "dangling.h5"):
        with pytest.raises(DataError, match="exists, and a record is never written over"):
            check_output(tmp_path / name, LOG)
        with pytest.raises(DataError, match="exists, and a record is never written over"), creating(tmp_path / name):
            pytest.fail("nothing may be written")
    assert (tmp_path / "f.h5").read_text() == "old"


def test_what_could_not_be_created_leaves_its_name_free(tmp_path):
    with pytest.raises(ZeroDivisionError), creating(tmp_path / "f"):
        raise ZeroDivisionError
    assert names(tmp_path) == []
    with creating(tmp_path / "f") as partial:
        partial.write_text("new")
    assert (tmp_path / "f").read_text() == "new"
    assert names(tmp_path) == ["f"]
