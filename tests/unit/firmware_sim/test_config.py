"""SIM.toml: everything shipped loads, everything wrong is refused in one line."""

import pytest

from firmware_sim.config import load_sim
from smadrive.errors import ConfigError
from smadrive.files.shipped import configs_dir

SIMS = sorted((configs_dir() / "sims").glob("*.toml"))


@pytest.mark.parametrize("path", SIMS, ids=lambda path: path.stem)
def test_every_shipped_sim_loads_by_name_and_by_path(path):
    assert load_sim(path.stem) == load_sim(path)


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("[wire]", "[wire]\nstroke_m = 1.0", r"wire\.stroke_m.*did you mean 'stroke_mm'"),
        ("lag_s = 0.15", "lag_s = -1", r"thermocouple\.lag_s: .*greater than or equal to 0.*-1"),
        ("watchdog_s = 0.5", "watchdog_s = 0.01", r"board\.watchdog_s"),
        ("[sense]", "[senses]", r"senses.*did you mean 'sense'|sense.*missing"),
        ("range_c = [0.0, 200.0]", "range_c = [200.0, 0.0]", r"range_c \(200.0, 0.0\) must rise"),
        ("[wire]", "[wire", "not valid TOML"),
    ],
)
def test_what_is_wrong_is_named(tmp_path, old, new, says):
    path = tmp_path / "bad.toml"
    path.write_text(
        (configs_dir() / "sims" / "flexinol-lt-0.15mm.toml").read_text(encoding="utf-8").replace(old, new, 1),
        encoding="utf-8",
    )
    with pytest.raises(ConfigError, match=says) as error:
        load_sim(path)
    assert str(error.value).startswith(f"{path}: ")
    assert "\n" not in str(error.value)


def test_an_unknown_name_lists_the_known():
    with pytest.raises(ConfigError, match=r"'flexinol': .*sims .*flexinol-lt-0.15mm"):
        load_sim("flexinol")
