"""Rig files, and the files that they name."""

import json
from math import inf
from pathlib import Path

import pytest
import tomlkit

from smadrive.errors import ConfigError, DataError
from smadrive.files.shipped import configs_dir
from smadrive.measurement import DisplacementFrom
from smadrive.rig.config import load_rig, rig_file
from smadrive.rig.switching_off.off_config import load_off_config
from smadrive.tuning.page.save import save_tuning
from smadrive.wire.data_sheet import load_data_sheet


@pytest.fixture
def folder(tmp_path):
    """A folder with a rig file, its wire and its profile. The rig file names a model that does not exist yet."""
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


def test_paths_are_relative_to_the_folder_of_the_rig_file(folder, monkeypatch):
    monkeypatch.chdir(folder.parent)
    rig = load_rig("bench/rig.toml")
    assert load_data_sheet(rig.wire).heat_balance().heat_capacity_j_per_k > 0.0
    assert (rig.model, rig.devices[0].profile) == ("bench/m.json", "bench/sma-reference.toml")
    monkeypatch.chdir(folder)
    assert load_rig("rig.toml").wire == "mine.toml"


def test_names_of_shipped_files_stay():
    assert load_rig("in-process").wire == tomlkit.parse(rig_file("in-process").read_text(encoding="utf-8"))["wire"]


TUNED = {
    "tuning": {
        "wire": json.dumps({"provenance": {}}),
        "change": "none",
        "feedback": {"closed_loop_s": 0.5},
        "displacement_from": "resistance",
        "caveats": ["it drifts"],
    },
    "rig": "r",
    "events": [],
}


@pytest.mark.parametrize("place", ["bench", "elsewhere"])
def test_saved_tuning_finds_the_files_of_the_rig(folder, place):
    to = folder.parent / place
    to.mkdir(exist_ok=True)
    model, rig = save_tuning(to, "tuned", folder / "rig.toml", TUNED)
    assert json.loads(model.read_text(encoding="utf-8"))["provenance"]["caveats"] == ["it drifts"]
    saved = load_rig(str(rig))
    assert saved.model == str(model)
    assert load_data_sheet(saved.wire).heat_balance().heat_capacity_j_per_k > 0.0
    assert saved.feedback.closed_loop_s == 0.5
    assert saved.displacement_from is DisplacementFrom.RESISTANCE


@pytest.mark.parametrize(
    "text", [None, b"rate_hz = ", b"rate_hz = 20.0", b"\xff"], ids=["gone", "torn", "none", "bytes"]
)
def test_tuning_is_saved_completely_or_not_at_all(folder, text):
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


def test_tuning_without_a_name_is_not_saved(folder):
    with pytest.raises(ConfigError) as refused:
        save_tuning(folder, "", folder / "rig.toml", TUNED)
    assert refused.value.cure == "type a name into the field beside Save"


def test_model_is_removed_when_its_rig_cannot_be_written(folder):
    (folder / "tuned.toml").symlink_to(folder / "absent" / "tuned.toml")
    with pytest.raises(DataError, match=r"tuned\.toml"):
        save_tuning(folder, "tuned", folder / "rig.toml", TUNED)
    assert not (folder / "tuned.json").exists()


@pytest.mark.parametrize("noise_c", [0.0, 1e-300, 100.0, 1e300])
def test_noise_outside_that_of_thermocouples_is_an_error(folder, noise_c):
    document = tomlkit.parse((folder / "rig.toml").read_text(encoding="utf-8"))
    document["feedback"] = {"noise_c": noise_c}
    (folder / "rig.toml").write_text(tomlkit.dumps(document), encoding="utf-8")
    with pytest.raises(ConfigError, match=r"feedback\.noise_c"):
        load_rig(str(folder / "rig.toml"))


def edited(folder, **tables):
    document = tomlkit.parse((folder / "rig.toml").read_text(encoding="utf-8"))
    for key, value in tables.items():
        if isinstance(value, dict):
            document[key].update(value)
        else:
            document[key] = value
    (folder / "rig.toml").write_text(tomlkit.dumps(document), encoding="utf-8")
    return str(folder / "rig.toml")


@pytest.mark.parametrize(
    ("tables", "key"),
    [
        ({"devices": [{"name": "a", "profile": "sma-reference", "url": "sim://x"}] * 2}, "same name"),
        ({"excitation": {"low_c": 130.0}}, r"excitation\.low_c = 130"),
        ({"excitation": {"high_c": 140.0}}, r"limits\.temperature_max_c = 135"),
        ({"excitation": {"high_c": 318.0}}, r"Is it in kelvin\? 318 K is 45 °C"),
        ({"limits": {"temperature_min_c": 200.0}}, r"limits\.temperature_min_c = 200"),
        ({"limits": {"displacement_min_mm": 5.0, "displacement_max_mm": 4.0}}, r"limits\.displacement_min_mm = 5"),
        ({"limits": {"watchdog_s": 0.05}}, r"limits\.watchdog_s = 0\.05"),
    ],
)
def test_values_that_contradict_each_other_are_an_error(folder, tables, key):
    with pytest.raises(ConfigError, match=key):
        load_rig(edited(folder, **tables))


@pytest.mark.parametrize("name", ["closed_loop_s", "integral_s"])
def test_feedback_faster_than_the_ticks_is_an_error(name):
    rig = load_rig("in-process")
    with pytest.raises(ConfigError, match=name) as caught:
        rig.check_feedback(rig.feedback.model_copy(update={name: 0.01}))
    assert caught.value.value == "0.01 s"


def test_feedback_faster_than_the_ticks_in_a_file_names_the_file(folder):
    path = Path(edited(folder))
    path.write_text(f"{path.read_text()}\n[feedback]\nclosed_loop_s = 0.001\n")
    with pytest.raises(ConfigError) as caught:
        load_rig(path)
    assert caught.value.where == str(path)


def test_slow_rig_has_a_slower_temperature_loop(folder):
    assert load_rig(edited(folder)).feedback.closed_loop_s == 0.25
    assert load_rig(edited(folder, rate_hz=5.0, limits={"watchdog_s": 1.0})).feedback.closed_loop_s == 0.5


def test_excitation_is_nested_unless_the_file_sets_its_plan(folder):
    excitation = load_rig(edited(folder)).excitation
    assert (excitation.plan, excitation.reversals, excitation.duration_s) == ("nested", None, None)
    excitation = load_rig(edited(folder, excitation={"plan": "forc", "duration_s": 600.0})).excitation
    assert (excitation.plan, excitation.reversals, excitation.duration_s) == ("forc", None, 600.0)


@pytest.mark.parametrize(
    ("excitation", "key"),
    [
        ({"plan": "spiral"}, r"excitation\.plan"),
        ({"plans": "forc"}, r"excitation\.plans: .*'plan'"),
        ({"duration": 600.0}, r"excitation\.duration: .*'duration_s'"),
        ({"duration_s": 0.0}, r"excitation\.duration_s"),
        ({"duration_s": 86_401.0}, r"excitation\.duration_s"),
        ({"duration_s": "600"}, r"duration_s"),
        ({"reversals": 1}, r"excitation\.reversals"),
        ({"reversals": 41}, r"excitation\.reversals"),
        ({"reversals": 5, "duration_s": 600.0}, "reversals = 5 and duration_s = 600 .*: give one"),
    ],
)
def test_wrong_plan_of_the_excitation_is_an_error_with_its_key(folder, excitation, key):
    with pytest.raises(ConfigError, match=key):
        load_rig(edited(folder, excitation=excitation))


def test_off_reads_the_addresses_of_a_rig_file_with_other_errors(folder):
    limits = {"temperature_max_c": "hot", "current_max_a": 0.045}
    config = load_off_config(edited(folder, rate_hz="fast", limits=limits))
    assert [device.name for device in config.devices] == ["board"]
    assert (config.current_max_a, config.mistakes) == (0.045, ())
    assert load_off_config("in-process").current_max_a == 0.6


@pytest.mark.parametrize("limits", [*({"current_max_a": given} for given in ("0.6", True, -1, inf)), 0.6])
def test_off_warns_of_a_current_limit_that_it_cannot_read(folder, limits):
    config = load_off_config(edited(folder, limits=limits))
    assert config.current_max_a == inf
    assert [mistake.where.endswith("limits.current_max_a") for mistake in config.mistakes] == [True]


@pytest.mark.parametrize("devices", ["board", [1]])
def test_off_reports_devices_that_it_cannot_read(folder, devices):
    config = load_off_config(edited(folder, devices=devices))
    assert config.devices == ()
    assert "devices" in config.device_mistake.where or "devices" in config.device_mistake.what
