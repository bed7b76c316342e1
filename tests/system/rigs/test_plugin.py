"""The fixtures work in another project: pytest runs the example of the guide in a folder of its own."""

import re
from pathlib import Path

import pytest

pytest_plugins = ["pytester"]

GUIDE = (Path(__file__).parents[3] / "docs" / "testing.md").read_text()
CONFTEST, EXAMPLE = re.findall(r"```python\n(.*?)```", GUIDE, re.DOTALL)
BY_NAME = """
import pytest

@pytest.mark.sma(rig="{rig}")
def test_a_rig_of_ones_own(sma_rig, sma_faults):
    assert sma_rig.config.name == "mine"
    with pytest.raises(AttributeError, match="'open_thermocouple'"):
        sma_faults.open_termocouple()
"""

MISTAKEN = """
import pytest

@pytest.mark.sma({said})
def test_never_runs(sma_rig):
    pass
"""


def test_the_example_of_the_guide_passes(pytester):
    pytester.makeconftest(CONFTEST)
    pytester.makepyfile(EXAMPLE)
    pytester.runpytest_subprocess("-p", "no:cacheprovider").assert_outcomes(passed=3)


def test_own_rig_file_is_simulated_whatever_devices_it_names(pytester):
    rig = (Path(__file__).parents[3] / "configs" / "rigs" / "simulated.toml").read_text()
    own = pytester.path / "mine.toml"
    own.write_text(rig.replace('"simulated bench"', '"mine"').replace("/tmp/smadrive-sim", "/dev/ttyUSB9"))  # noqa: S108
    pytester.makeconftest(CONFTEST)
    pytester.makepyfile(BY_NAME.format(rig=own))
    pytester.runpytest_subprocess("-p", "no:cacheprovider").assert_outcomes(passed=1)


@pytest.mark.parametrize(
    ("said", "told"),
    [
        ('rigg="in-process"', "*unknown part 'rigg'. Did you mean 'rig'?*"),
        ('"in-process"', "*'in-process' has no name. Write rig=, sim= or seed= before it*"),
    ],
)
def test_wrong_marker_gives_no_rig(pytester, said, told):
    pytester.makeconftest(CONFTEST)
    pytester.makepyfile(MISTAKEN.format(said=said))
    result = pytester.runpytest_subprocess("-p", "no:cacheprovider")
    result.assert_outcomes(errors=1)
    result.stdout.fnmatch_lines([told])
