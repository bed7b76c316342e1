"""The fingerprint of a campaign: it depends on the content of all files, and not on their folder."""

import shutil

import pytest

import smadrive.campaigns.plan.plan
from smadrive.campaigns.campaign import check_plan
from smadrive.campaigns.plan.plan import SAMPLED, load_plan
from smadrive.errors import ConfigError
from smadrive.files.shipped import configs_dir

TRACK = """
title = "x"
[run]
reference = "table"
model = "wire.json"
rig.file = "rig.toml"
sim.file = "sim.toml"
[[vary]]
seed = [1, 2]
[references.table]
file = "table.csv"
"""
FIT = """
title = "x"
[run]
experiment = "fit"
[[vary]]
records = "*.csv"
"""


@pytest.fixture
def folder(tmp_path):
    """A folder with a campaign, and with its own copies of all files that the runs read."""
    folder = tmp_path / "folder"
    folder.mkdir()
    shipped = configs_dir()
    rig = (shipped / "rigs" / "in-process.toml").read_text(encoding="utf-8")
    for name, own in (("sma-reference", "board.toml"), ("flexinol-lt-0.15mm", "wire.toml")):
        assert f'"{name}"' in rig
        rig = rig.replace(f'"{name}"', f'"{own}"')
    (folder / "rig.toml").write_text(rig, encoding="utf-8")
    shutil.copy(shipped / "devices" / "sma-reference.toml", folder / "board.toml")
    shutil.copy(shipped / "wires" / "flexinol-lt-0.15mm.toml", folder / "wire.toml")
    shutil.copy(shipped / "sims" / "flexinol-lt-0.15mm.toml", folder / "sim.toml")
    for name in ("wire.json", "table.csv"):
        (folder / name).write_text(name)
    (folder / "campaign.toml").write_text(TRACK)
    return folder


def fingerprint(folder):
    return load_plan(str(folder / "campaign.toml")).fingerprint


def copied(folder, name):
    """A copy of a folder."""
    return shutil.copytree(folder, folder.with_name(name))


def test_copy_of_a_campaign_has_its_fingerprint(folder):
    assert fingerprint(folder) == fingerprint(copied(folder, "copy"))


CHANGES = {
    "board.toml": ("response_timeout_ms = 60", "response_timeout_ms = 61"),
    "rig.toml": ("current_max_a = 0.6", "current_max_a = 0.5"),
    "sim.toml": ("stroke_mm = 12.0", "stroke_mm = 11.0"),
    "wire.toml": ("ambient_c = 22.0", "ambient_c = 23.0"),
}


def change(path, before, after):
    text = path.read_text(encoding="utf-8")
    assert before in text
    path.write_text(text.replace(before, after, 1), encoding="utf-8")


@pytest.mark.parametrize(
    ("name", "before", "after"),
    [
        *((name, *texts) for name, texts in CHANGES.items()),
        ("rig.toml", "rate_hz =", 'displacement_from = "none"\nrate_hz ='),
        ("campaign.toml", "seed = [1, 2]", "seed = [1, 3]"),
        ("wire.json", "wire", "other"),
        ("table.csv", "table", "other"),
    ],
)
def test_content_of_every_file_counts(folder, name, before, after):
    copy = copied(folder, "copy")
    change(copy / name, before, after)
    assert fingerprint(folder) != fingerprint(copy)


@pytest.mark.parametrize(
    ("key", "name"),
    [
        ("rig.file", "rig.toml"),
        ("sim.file", "sim.toml"),
        ("rig.wire", "wire.toml"),
        ("rig.devices.board.profile", "board.toml"),
    ],
)
def test_file_of_a_run_outside_the_sample_counts(folder, monkeypatch, key, name):
    monkeypatch.setattr(smadrive.campaigns.plan.plan, "SAMPLED", 2)
    for number in range(3):
        shutil.copy(folder / name, folder / f"{number}.toml")
    settings = TRACK.replace(f'{key} = "{name}"\n', "")
    numbers = "[[vary]]\nrig.rate_hz = [10.0, 20.0]\n"
    files = f'[[vary]]\n{key} = ["0.toml", "1.toml", "2.toml"]\n'
    (folder / "campaign.toml").write_text(settings + numbers + files)
    before = fingerprint(folder)
    change(folder / "1.toml", *CHANGES[name])
    assert fingerprint(folder) != before


def test_report_does_not_count(folder):
    copy = copied(folder, "copy")
    with (copy / "campaign.toml").open("a") as file:
        file.write("[report]\nmetric = 'max_percent'\nby = ['wire_kind']\nworst_logs = 1\n")
    assert fingerprint(folder) == fingerprint(copy)


def test_comment_in_a_file_does_not_count(folder):
    copy = copied(folder, "copy")
    for name in ("campaign.toml", "rig.toml", "board.toml", "wire.toml", "sim.toml"):
        path = copy / name
        path.write_text("# a comment\n" + path.read_text(encoding="utf-8"), encoding="utf-8")
    assert fingerprint(folder) == fingerprint(copy)


@pytest.fixture
def many_records(tmp_path):
    """The plan of a campaign with more runs than a sample has, and the record of a run that is not in the sample."""
    (tmp_path / "campaign.toml").write_text(FIT)
    for number in range(2 * SAMPLED):
        (tmp_path / f"{number}.csv").touch()
    plan = load_plan(str(tmp_path / "campaign.toml"))
    left_out = min(set(range(plan.count)) - {run.number for run in plan.sample()})
    return plan, tmp_path / plan.run(left_out).settings.record


def test_record_of_a_run_outside_the_sample_counts(many_records):
    plan, record = many_records
    before = plan.fingerprint
    record.write_text("changed")
    assert load_plan(str(plan.path)).fingerprint != before


def test_missing_record_of_a_run_outside_the_sample_is_found(many_records):
    plan, record = many_records
    check_plan(plan)
    record.unlink()
    with pytest.raises(ConfigError) as caught:
        check_plan(plan)
    assert caught.value.where == str(record)
