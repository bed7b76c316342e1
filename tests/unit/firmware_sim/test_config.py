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
    ("old", "new", "named"),
    [
        ("[wire]", "[wire]\nstroke_m = 1.0", ("wire.stroke_m: ", "'stroke_mm'")),
        ("lag_s = 0.15", "lag_s = -1", ("thermocouple.lag_s: ", " 0 ", "-1")),
        ("watchdog_s = 0.5", "watchdog_s = 0.01", ("board.watchdog_s: ",)),
        ("[sense]", "[senses]", ("senses: ", "'sense'")),
        ("range_c = [0.0, 200.0]", "range_c = [200.0, 0.0]", ("range_c (200.0, 0.0)",)),
        ("[wire]", "[wire", ("line ",)),
    ],
)
def test_error_names_file_and_key_in_one_line(tmp_path, old, new, named):
    path = tmp_path / "bad.toml"
    path.write_text(
        (configs_dir() / "sims" / "flexinol-lt-0.15mm.toml").read_text(encoding="utf-8").replace(old, new, 1),
        encoding="utf-8",
    )
    with pytest.raises(ConfigError) as error:
        load_sim(path)
    assert error.value.where == str(path)
    assert all(part in error.value.what for part in named)
    assert "\n" not in str(error.value)


def test_error_for_unknown_name_lists_shipped_names():
    with pytest.raises(ConfigError) as error:
        load_sim("flexinol")
    assert error.value.where == "'flexinol'"
    assert error.value.value == ", ".join(path.stem for path in SIMS)
