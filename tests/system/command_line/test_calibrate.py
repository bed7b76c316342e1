"""`smadrive calibrate` in virtual time, as a user types it, and with mistakes."""

import json
import sys

import programs
import pytest

from smadrive.files.shipped import configs_dir

SHIPPED = configs_dir() / "rigs" / "in-process.toml"


@pytest.fixture
def smadrive(tmp_path):
    (tmp_path / "rig.toml").write_text(SHIPPED.read_text())

    def run(*arguments, keys="\n\n\n"):
        command = [sys.executable, "-m", "smadrive", *arguments]
        return programs.run(command, cwd=tmp_path, input=keys, capture_output=True, text=True, check=False)

    return run


def test_offset_is_found_from_raw_readings_and_shown_by_probe(smadrive):
    for _ in range(2):  # the second calibration must not see the correction of the first
        done = json.loads(smadrive("calibrate", "rig.toml", "temperature", "--point", "25", "--json").stdout)
        assert done["offset_c"] == pytest.approx(3.0, abs=0.1)
        assert done["scale"] == 1.0
    probed = json.loads(smadrive("probe", "rig.toml", "--json").stdout)
    assert probed["temperature_c"] == pytest.approx(25.0, abs=0.5)
    assert probed["calibration"]["temperature"]["offset_c"] == done["offset_c"]
    assert probed["calibration"]["displacement"] is None


def test_mistyped_known_value_is_doubted_and_no_advice_raises_a_current(smadrive):
    done = json.loads(smadrive("calibrate", "rig.toml", "temperature", "--point", "2.2", "--json").stdout)
    assert done["offset_c"] == pytest.approx(-19.8, abs=0.1)
    assert "ambient_c = 22 °C" in done["caveats"][-1]
    (caveat,) = json.loads(smadrive("probe", "rig.toml", "--json").stdout)["caveats"]
    assert "ambient_c = 22 °C" in caveat
    heated = smadrive("heat", "rig.toml", "--current", "0.1", "--for", "1", "-o", "warm.h5")
    assert f"warning: {caveat[:20]}" in heated.stdout
    excited = smadrive("excite", "rig.toml", "-o", "excitation.h5")
    assert (excited.returncode, "current" in excited.stderr) == (2, False)
    assert "calibrate the thermocouple again" in excited.stderr.lower()


def test_mistyped_hot_point_is_doubted_although_it_is_right_at_ambient(smadrive, tmp_path):
    """0.2 °C read at 0 °C and 99.6 °C at a mistyped 80 °C."""
    table = "[calibration.temperature]\noffset_c = -0.16\noffset_uncertainty_c = 0.2\nscale = 0.805\non = 2026-11-01\n"
    (tmp_path / "rig.toml").write_text(f"{SHIPPED.read_text()}\n{table}")
    caveats = json.loads(smadrive("probe", "rig.toml", "--json").stdout)["caveats"]
    assert any("temperature_max_c" in text for text in caveats)


def test_calibration_near_ambient_is_not_doubted(smadrive):
    done = json.loads(smadrive("calibrate", "rig.toml", "temperature", "--point", "25", "--json").stdout)
    assert not any("ambient_c" in text for text in done["caveats"])
    assert json.loads(smadrive("probe", "rig.toml", "--json").stdout)["caveats"] == []


@pytest.mark.parametrize(
    ("arguments", "keys"),
    [
        (("rig.toml", "temperature", "--point", "100"), "\n"),
        (("rig.toml", "temperature", "--point", "ice"), ""),
        (("rig.toml", "temperature", "--point", "ice", "--point", "boiling"), "\n\n"),
        (("rig.toml", "temperature", "--point", "warm"), "\n"),
        (("rig.toml", "temperature", "--point", "nan"), "\n"),
        (("rig.toml", "displacement", "--point", "ice"), "\n"),
        (("rig.toml", "force", "--point", "1"), "\n"),
        (("rig.toml", "temperature"), "\n"),
        (("in-process", "temperature", "--point", "22"), "\n"),
    ],
    ids=lambda value: " ".join(value[1:]) if isinstance(value, tuple) else "",
)
def test_mistake_leaves_the_rig_file(smadrive, tmp_path, arguments, keys):
    done = smadrive("calibrate", *arguments, keys=keys)
    assert done.returncode == 2
    assert "Traceback" not in done.stderr
    assert (tmp_path / "rig.toml").read_text() == SHIPPED.read_text()


@pytest.mark.parametrize(
    ("arguments", "devices"),
    [
        (("displacement", "--point", "1"), 'measures = ["temperature"]'),
        (("temperature", "--point", "ice", "--point", "0"), ""),
        (("temperature", "--point", "5000"), ""),
        (("temperature", "--point", "25,5"), ""),
        (("displacement", "--point", "1e5"), ""),
    ],
    ids=["no such sensor", "the same point twice", "5000 °C", "a decimal comma", "100 m"],
)
def test_mistake_that_is_known_before_is_an_error_without_a_question(smadrive, tmp_path, arguments, devices):
    text = SHIPPED.read_text().replace("unit_id = 1", f"unit_id = 1\n{devices}")
    (tmp_path / "rig.toml").write_text(text)
    done = smadrive("calibrate", "rig.toml", *arguments, keys="")
    assert (done.returncode, done.stdout) == (2, "")
    assert "press Enter" not in done.stderr
    assert len(done.stderr.splitlines()) == 1
