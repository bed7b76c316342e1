"""The journal of a campaign: kills, damage, full disks, and commands that may not use the folder."""

import os
import resource
import signal
from contextlib import contextmanager
from importlib.metadata import version

import pytest

from smadrive.campaigns.execution.journal import COPY, JOURNAL, SCHEMA, Journal
from smadrive.campaigns.experiments.run import Effort, RunResult
from smadrive.errors import DataError
from smadrive.files.checked_line import checked_line, fields_of_line

RESULT = RunResult({"rms_percent": 0.1 + 0.2, "max_percent": float("nan")}, Effort("", 1.0, 1.0, 0.0, "host:1"))


def test_an_interrupted_journal_goes_on(short_campaign, tmp_path):
    plan, folder = short_campaign(), tmp_path / "folder"
    with Journal(folder, plan, resume=False) as journal:
        journal.add(1, RESULT)
        journal.add(0, RESULT)
    path = folder / JOURNAL
    path.write_bytes(path.read_bytes()[:-7])  # the last line is cut, as by a kill
    with Journal(folder, plan, resume=True) as journal:
        assert list(journal.results) == [1]
        assert repr(journal.results[1]) == repr(RESULT)
        journal.add(0, RESULT)
    with Journal(folder, plan, resume=True) as journal:
        assert sorted(journal.results) == [0, 1]


DAMAGED = [
    b"\0" * 200 + b"\n",
    b'{"run": 3, "row"',
    b"\xff\xfe\n",
    b"[1]\n",
    b"[" * 200_000 + b"\n",
    b'{"run": 1, "row": {}, "effort": {}}\n',
]


@pytest.mark.parametrize("damaged", DAMAGED)
def test_damaged_end_of_a_journal_is_repeated(short_campaign, tmp_path, damaged):
    plan, folder = short_campaign(), tmp_path / "folder"
    with Journal(folder, plan, resume=False) as journal:
        journal.add(0, RESULT)
    whole = (folder / JOURNAL).read_bytes()
    (folder / JOURNAL).write_bytes(whole + damaged)
    with Journal(folder, plan, resume=True) as journal:
        assert list(journal.results) == [0]
    assert (folder / JOURNAL).read_bytes() == whole


def test_changed_digit_of_a_journal_is_damage(short_campaign, tmp_path):
    plan, folder = short_campaign(), tmp_path / "folder"
    with Journal(folder, plan, resume=False) as journal:
        journal.add(0, RESULT)
        first = (folder / JOURNAL).read_bytes()
        journal.add(1, RESULT)
    second = (folder / JOURNAL).read_bytes().removeprefix(first)
    (folder / JOURNAL).write_bytes(first + second.replace(b'"run": 1', b'"run": 2'))
    with Journal(folder, plan, resume=True) as journal:
        assert list(journal.results) == [0]


def head_of(plan, folder):
    """The first line of the journal of a plan. The journal is in the new folder `folder`."""
    with Journal(folder, plan, resume=False) as journal:
        journal.add(0, RESULT)
    return (folder / JOURNAL).read_bytes().splitlines(keepends=True)[0]


def test_damaged_first_line_is_named(short_campaign, tmp_path):
    (tmp_path / JOURNAL).write_bytes(b"\0\0\n")
    with pytest.raises(DataError) as caught, Journal(tmp_path, short_campaign(), resume=True):
        pass
    assert caught.value.where == str(tmp_path / JOURNAL)


@pytest.mark.parametrize("kept", [0, 10, -1])
def test_journal_whose_first_line_is_cut_is_begun_again(short_campaign, tmp_path, kept):
    plan, folder = short_campaign(), tmp_path / "folder"
    head = head_of(plan, tmp_path / "whole")
    folder.mkdir()
    (folder / JOURNAL).write_bytes(head[:kept])
    with Journal(folder, plan, resume=True) as journal:
        assert journal.results == {}
        journal.add(1, RESULT)
    assert (folder / JOURNAL).read_bytes().startswith(head)
    assert (folder / COPY).read_text(encoding="utf-8") == plan.text
    with Journal(folder, plan, resume=True) as journal:
        assert list(journal.results) == [1]


def test_campaign_file_of_another_campaign_is_kept_before_its_first_line(short_campaign, tmp_path):
    plan, folder = short_campaign(), tmp_path / "folder"
    folder.mkdir()
    (folder / JOURNAL).touch()
    (folder / COPY).write_bytes(b"\xff")
    with pytest.raises(DataError) as caught, Journal(folder, plan, resume=True):
        pass
    assert caught.value.where == str(folder)
    assert (folder / COPY).read_bytes() == b"\xff"


@pytest.mark.parametrize("text", [b'{"event": "started"}', b"\0" * 64, b"{}"], ids=["json", "zeros", "empty"])
def test_file_of_another_program_is_kept(short_campaign, tmp_path, text):
    """Its only line has no end, like a line that a kill has cut."""
    folder = tmp_path / "folder"
    folder.mkdir()
    (folder / JOURNAL).write_bytes(text)
    with pytest.raises(DataError) as caught, Journal(folder, short_campaign(), resume=True):
        pass
    assert caught.value.where == str(folder / JOURNAL)
    assert (folder / JOURNAL).read_bytes() == text
    assert list(folder.iterdir()) == [folder / JOURNAL]


def test_journal_of_another_schema_is_named(short_campaign, tmp_path):
    plan = short_campaign()
    fields = fields_of_line(head_of(plan, tmp_path / "whole"))
    (tmp_path / JOURNAL).write_bytes(checked_line({**fields, "schema": SCHEMA + 1}))
    with pytest.raises(DataError) as caught, Journal(tmp_path, plan, resume=True):
        pass
    assert caught.value.limit == SCHEMA


@contextmanager
def largest_file(size):
    """In the `with` block, this process cannot write a file of more than `size` bytes, as on a full disk."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    before = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
        signal.signal(signal.SIGXFSZ, before)


def lose_a_run(plan, folder, done):
    """Add `done` runs to a new journal, and then one that the disk does not hold."""
    with Journal(folder, plan, resume=False) as journal:
        for number in range(done):
            journal.add(number, RESULT)
        with largest_file((folder / JOURNAL).stat().st_size + 20):
            journal.add(done, RESULT)


@pytest.mark.parametrize("done", [0, 1])
def test_run_that_a_full_disk_lost_is_not_done(short_campaign, tmp_path, done):
    plan, folder = short_campaign(), tmp_path / "folder"
    with pytest.raises(DataError):
        lose_a_run(plan, folder, done)
    with Journal(folder, plan, resume=True) as journal:
        assert list(journal.results) == list(range(done))
        journal.add(done, RESULT)


def test_full_disk_at_the_start_leaves_nothing(short_campaign, tmp_path):
    plan, folder = short_campaign(), tmp_path / "folder"
    with largest_file(20), pytest.raises(DataError), Journal(folder, plan, resume=False):
        pass
    assert not folder.exists()
    with Journal(folder, plan, resume=False) as journal:
        journal.add(0, RESULT)


def lose_the_disk(plan, folder, error):
    """Add a run to a new journal that cannot be synchronized: its file becomes a pipe. Then raise `error`, if any."""
    with Journal(folder, plan, resume=False) as journal:
        journal.add(0, RESULT)
        read_end, write_end = os.pipe()
        os.dup2(write_end, journal._file.fileno())
        os.close(read_end)
        os.close(write_end)
        if error is not None:
            raise error


@pytest.mark.parametrize("error", [None, KeyboardInterrupt])
def test_failed_synchronization_is_an_error_and_hides_no_other_one(short_campaign, tmp_path, error):
    with pytest.raises(error or DataError):
        lose_the_disk(short_campaign(), tmp_path / "folder", error)


@pytest.mark.parametrize("resume", [False, True])
def test_two_commands_cannot_use_one_folder(short_campaign, tmp_path, resume):
    plan, folder = short_campaign(), tmp_path / "folder"
    with Journal(folder, plan, resume=False) as journal:
        journal.add(0, RESULT)
        with pytest.raises(DataError) as caught, Journal(folder, plan, resume=resume):
            pass
        assert caught.value.where == str(folder)
        journal.add(1, RESULT)
    with Journal(folder, plan, resume=True) as journal:
        assert sorted(journal.results) == [0, 1]


def test_another_campaign_does_not_go_on_in_the_folder(short_campaign, tmp_path):
    folder = tmp_path / "folder"
    with Journal(folder, short_campaign(), resume=False) as journal:
        journal.add(0, RESULT)
    other = short_campaign(run="seed = 8", name="other.toml")
    with pytest.raises(DataError) as caught, Journal(folder, other, resume=True):
        pass
    assert caught.value.where == str(folder)
    with Journal(folder, short_campaign(), resume=True) as journal:
        assert list(journal.results) == [0]


def test_campaign_goes_on_with_another_report(short_campaign, tmp_path):
    folder = tmp_path / "folder"
    with Journal(folder, short_campaign(), resume=False) as journal:
        journal.add(0, RESULT)
    corrected = short_campaign(more='[report]\nby = ["wire_kind"]\n', name="other.toml")
    with Journal(folder, corrected, resume=True) as journal:
        assert list(journal.results) == [0]


@pytest.mark.parametrize("package", ["numpy", "pyarrow"])
def test_a_campaign_does_not_go_on_with_other_versions(short_campaign, tmp_path, package):
    folder = tmp_path / "folder"
    with Journal(folder, short_campaign(), resume=False) as journal:
        journal.add(0, RESULT)
    head, *runs = (folder / JOURNAL).read_bytes().splitlines(keepends=True)
    fields = fields_of_line(head)
    assert fields["versions"][package] == version(package)
    fields["versions"][package] = "1.0"
    (folder / JOURNAL).write_bytes(b"".join([checked_line(fields), *runs]))
    with pytest.raises(DataError) as caught, Journal(folder, short_campaign(), resume=True):
        pass
    assert f"{package} 1.0" in caught.value.value


def test_failure_that_is_not_final_is_repeated(short_campaign, tmp_path):
    plan, folder = short_campaign(), tmp_path / "folder"
    with Journal(folder, plan, resume=False) as journal:
        journal.add(0, RESULT._replace(is_final=False))
        journal.add(1, RESULT)
        assert sorted(journal.results) == [0, 1]
        assert journal.not_final == 1
    with Journal(folder, plan, resume=True) as journal:
        assert list(journal.results) == [1]
