"""SIM.toml: shipped files load, wrong ones are rejected in one line."""

import pytest

from firmware_sim.config import load_sim
from smadrive.errors import ConfigError
from smadrive.files.shipped import configs_dir

SIMS = sorted((configs_dir() / "sims").glob("*.toml"))


@pytest.mark.parametrize("path", SIMS, ids=lambda path: path.stem)
def test_shipped_sim_loads_by_name_and_by_path(path):
    assert load_sim(path.stem) == load_sim(path)


@pytest.mark.parametrize(
    ("old", "new", "key"),
    [
        ("[wire]", "[wire]\nstroke_m = 1.0", r"wire\.stroke_m.*'stroke_mm'"),
        ("lag_s = 0.15", "lag_s = -1", r"thermocouple\.lag_s.*\b0\b.*-1"),
        ("watchdog_s = 0.5", "watchdog_s = 0.01", r"board\.watchdog_s"),
        ("[sense]", "[senses]", r"senses.*'sense'"),
        ("range_c = [0.0, 200.0]", "range_c = [200.0, 0.0]", r"range_c \(200.0, 0.0\)"),
        ("[wire]", "[wire", "TOML"),
    ],
)
def test_error_names_file_and_key_in_one_line(tmp_path, old, new, key):
    path = tmp_path / "bad.toml"
    path.write_text(
        (configs_dir() / "sims" / "flexinol-lt-0.15mm.toml").read_text(encoding="utf-8").replace(old, new, 1),
        encoding="utf-8",
    )
    with pytest.raises(ConfigError, match=key) as error:
        load_sim(path)
    assert str(error.value).startswith(f"{path}: ")
    assert "\n" not in str(error.value)


def test_error_for_unknown_name_lists_shipped_names():
    with pytest.raises(ConfigError, match=r"'flexinol'.*flexinol-lt-0.15mm"):
        load_sim("flexinol")
