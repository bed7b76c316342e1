"""A mistyped name of a file is an error that suggests the file with the nearest name, or with the nearest ending."""

import pytest

from smadrive.errors import ConfigError
from smadrive.files.config import read_toml
from smadrive.files.csv_table import read_table
from smadrive.files.spelling import NO_TEXT, suggested_file
from smadrive.hysteresis import load_model
from smadrive.rig.config import load_rig
from smadrive.rig.switching_off.off_config import load_off_config
from smadrive.runs.log.reader import read_log


@pytest.mark.parametrize(
    ("read", "typed", "present"),
    [
        (load_rig, "my-rgi.toml", "my-rig.toml"),
        (load_off_config, "my-rgi.toml", "my-rig.toml"),
        (read_table, "wier.csv", "wire.csv"),
        (read_log, "excitaton.h5", "excitation.h5"),
        (load_model, "wier.json", "wire.json"),
        (load_model, "wire.jsn", "wire.json"),
    ],
)
def test_nearest_file_is_suggested(tmp_path, read, typed, present):
    for name in (present, f"{typed}.txt", "other.md"):
        (tmp_path / name).touch()
    with pytest.raises(ConfigError) as error:
        read(tmp_path / typed)
    assert (error.value.where, error.value.cure) == (str(tmp_path / typed), f"did you mean '{tmp_path / present}'?")


@pytest.mark.parametrize("place", ["nothing.csv", "no/folder/wire.csv", "wire.csv\0"])
def test_missing_file_without_a_near_name_has_a_cure(tmp_path, place):
    with pytest.raises(ConfigError) as error:
        read_table(tmp_path / place)
    assert error.value.cure


@pytest.mark.parametrize("typed", ["my-rig", "my-rgi"])
def test_rig_file_without_its_ending_is_suggested(tmp_path, monkeypatch, typed):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "my-rig.toml").touch()
    with pytest.raises(ConfigError) as error:
        load_off_config(typed)
    assert error.value.cure == "did you mean 'my-rig.toml'?"


@pytest.mark.parametrize(("read", "name"), [(read_toml, "rig.toml"), (read_table, "data.csv")])
def test_binary_file_is_no_text_file(tmp_path, read, name):
    path = tmp_path / name
    path.write_bytes(bytes(range(256)))
    with pytest.raises(ConfigError) as error:
        read(path)
    assert (error.value.what, error.value.where) == (NO_TEXT, str(path))
    assert error.value.cure


@pytest.mark.parametrize(
    ("typed", "present"), [("nofile.h5", "offd.h5"), ("simulated.h5", "ma.h5"), ("sine.csv", "wire.csv")]
)
def test_file_with_another_name_is_not_suggested(tmp_path, typed, present):
    (tmp_path / present).touch()
    assert suggested_file(tmp_path / typed) == ""


@pytest.mark.parametrize(("typed", "near"), [("simulated.toml", "simulated"), ("in-proces.toml", "in-process")])
def test_shipped_name_with_an_ending_is_suggested_without_it(tmp_path, monkeypatch, typed, near):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "ma.toml").touch()
    with pytest.raises(ConfigError) as error:
        load_rig(typed)
    assert error.value.cure == f"did you mean the shipped '{near}', without .toml?"
