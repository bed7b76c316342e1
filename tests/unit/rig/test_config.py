"""A rig file and the files that it names."""

import json
import os

import pytest
import tomlkit

from smadrive.errors import ConfigError, DataError
from smadrive.files.shipped import configs_dir
from smadrive.rig.config import load_rig, rig_file
from smadrive.tuning.page.save import save_tuning
from smadrive.wire.data_sheet import load_data_sheet


@pytest.fixture
def folder(tmp_path):
    """A folder with a rig that names a wire and a profile beside it, and a model that is not there yet."""
    document = tomlkit.parse(rig_file("in-process").read_text(encoding="utf-8"))
    wire = (configs_dir() / "wires" / f"{document['wire']}.toml").read_text(encoding="utf-8")
    profile = document["devices"][0]["profile"]
    there = tmp_path / "bench"
    there.mkdir()
    (there / "mine.toml").write_text(wire, encoding="utf-8")
    (there / f"{profile}.toml").write_text((configs_dir() / "devices" / f"{profile}.toml").read_text(encoding="utf-8"))
    document.update({"wire": "mine.toml", "model": "m.json"})
    document["devices"][0]["profile"] = f"{profile}.toml"
    (there / "rig.toml").write_text(tomlkit.dumps(document), encoding="utf-8")
    return there


def test_what_it_names_lies_in_its_own_folder_wherever_one_works(folder, monkeypatch):
    monkeypatch.chdir(folder.parent)
    rig = load_rig("bench/rig.toml")
    assert load_data_sheet(rig.wire).heat_balance().heat_capacity_j_per_k > 0.0
    assert (rig.model, rig.devices[0].profile) == ("bench/m.json", "bench/sma-reference.toml")
    monkeypatch.chdir(folder)
    assert load_rig("rig.toml").wire == "mine.toml"


def test_shipped_ones_are_named_as_they_are():
    assert load_rig("in-process").wire == tomlkit.parse(rig_file("in-process").read_text(encoding="utf-8"))["wire"]


TUNED = {
    "tuning": {
        "wire": json.dumps({"provenance": {}}),
        "change": "none",
        "feedback": {"closed_loop_s": 0.5},
        "caveats": ["it drifts"],
    },
    "rig": "r",
    "events": [],
}


@pytest.mark.parametrize("place", ["bench", "elsewhere"])
def test_a_saved_tuning_finds_them_too(folder, place):
    to = folder.parent / place
    to.mkdir(exist_ok=True)
    model, rig = save_tuning(to, "tuned", folder / "rig.toml", TUNED)
    assert json.loads(model.read_text(encoding="utf-8"))["provenance"]["caveats"] == ["it drifts"]
    saved = load_rig(str(rig))
    assert saved.model == str(model)
    assert load_data_sheet(saved.wire).heat_balance().heat_capacity_j_per_k > 0.0
    assert saved.feedback.closed_loop_s == 0.5


@pytest.mark.parametrize(
    "text", [None, b"rate_hz = ", b"rate_hz = 20.0", b"\xff"], ids=["gone", "torn", "none", "bytes"]
)
def test_a_tuning_is_saved_whole_or_not_at_all(folder, text):
    rig = folder / "rig.toml"
    before = rig.read_bytes()
    rig.unlink()
    if text is not None:
        rig.write_bytes(text)
    with pytest.raises(ConfigError) as refused:
        save_tuning(folder, "tuned", rig, TUNED)
    assert refused.value.where == str(rig)
    assert not (folder / "tuned.json").exists()
    rig.write_bytes(before)
    assert all(path.exists() for path in save_tuning(folder, "tuned", rig, TUNED))


def test_a_tuning_without_a_name_is_not_saved(folder):
    with pytest.raises(ConfigError, match="name"):
        save_tuning(folder, "", folder / "rig.toml", TUNED)


def test_a_model_without_its_rig_is_taken_away_again(folder):
    (folder / f".tuned.toml.{os.getpid()}.partial").mkdir()
    with pytest.raises(DataError, match=r"tuned\.toml: cannot be written"):
        save_tuning(folder, "tuned", folder / "rig.toml", TUNED)
    assert not (folder / "tuned.json").exists()


@pytest.mark.parametrize("noise_c", [0.0, 1e-300, 100.0, 1e300])
def test_a_noise_that_no_thermocouple_has_is_refused(folder, noise_c):
    document = tomlkit.parse((folder / "rig.toml").read_text(encoding="utf-8"))
    document["feedback"] = {"noise_c": noise_c}
    (folder / "rig.toml").write_text(tomlkit.dumps(document), encoding="utf-8")
    with pytest.raises(ConfigError, match=r"feedback\.noise_c"):
        load_rig(str(folder / "rig.toml"))
