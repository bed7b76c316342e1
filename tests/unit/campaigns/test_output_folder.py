"""The output folder of a campaign: the copy of the campaign file, the way to go on, and folders that cannot be used."""

import errno
import os
import shlex

import pytest

from smadrive.campaigns.execution.journal import COPY, Journal
from smadrive.campaigns.experiments.run import Effort, RunResult
from smadrive.cli.campaign import main
from smadrive.errors import ConfigError, DataError

RESULT = RunResult({"rms_percent": 0.1}, Effort("", 1.0, 1.0, 0.0, "host:1"))


def test_interrupted_campaign_has_the_file_that_it_began_with(short_campaign, tmp_path):
    plan, folder = short_campaign(), tmp_path / "folder"
    with Journal(folder, plan, resume=False) as journal:
        assert (folder / COPY).read_text(encoding="utf-8") == plan.text
        journal.add(0, RESULT)
    same_settings = short_campaign(run="# a comment")
    with Journal(folder, same_settings, resume=True):
        pass
    assert (folder / COPY).read_text(encoding="utf-8") == plan.text


def test_a_campaign_without_a_run_leaves_nothing(short_campaign, tmp_path):
    for _ in range(2):
        with Journal(tmp_path / "folder", short_campaign(), resume=False):
            pass
    assert not (tmp_path / "folder").exists()


def test_a_campaign_without_a_run_leaves_the_folder_of_the_user(short_campaign, tmp_path):
    (tmp_path / "folder").mkdir()
    with Journal(tmp_path / "folder", short_campaign(), resume=False):
        pass
    assert list((tmp_path / "folder").iterdir()) == []


@pytest.mark.parametrize("resume", [False, True])
def test_file_in_place_of_the_folder_is_named(short_campaign, tmp_path, resume):
    """The cure is not --resume, which a file cannot have."""
    (tmp_path / "file.txt").write_text("kept")
    with pytest.raises(DataError) as caught, Journal(tmp_path / "file.txt", short_campaign(), resume=resume):
        pass
    assert caught.value.where == str(tmp_path / "file.txt")
    assert caught.value.value == os.strerror(errno.ENOTDIR)
    assert "--resume" not in caught.value.cure
    assert (tmp_path / "file.txt").read_text() == "kept"


def test_resume_needs_a_campaign_and_creates_no_folder(short_campaign, tmp_path):
    with pytest.raises(DataError), Journal(tmp_path / "nothing", short_campaign(), resume=True):
        pass
    assert not (tmp_path / "nothing").exists()


def test_interrupted_campaign_prints_the_command_that_goes_on(short_campaign, tmp_path):
    plan, folder = short_campaign(name="my file.toml"), tmp_path / "my folder"
    with Journal(folder, plan, resume=False) as journal:
        journal.add(0, RESULT)
    with pytest.raises(ConfigError) as caught:
        main(str(plan.path), folder, resume=True, scheduler="nowhere", as_json=True)
    (note,) = caught.value.__notes__
    command = shlex.split(note.split("`")[1])
    assert command[:5] == ["smadrive", "campaign", str(plan.path), "-o", str(folder)]
    assert sorted(command[5:]) == ["--json", "--resume", "--scheduler", "nowhere"]
