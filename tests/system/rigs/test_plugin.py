"""The fixtures work in another project: pytest runs the example of the guide in a folder of its own."""

import re
import shutil
from pathlib import Path

import pytest

pytest_plugins = ["pytester"]

GUIDE = (Path(__file__).parents[3] / "docs" / "testing.md").read_text()
(EXAMPLE,) = re.findall(r"```python\n(.*?)```", GUIDE, re.DOTALL)
PROJECT = Path(__file__).parents[3] / "docs" / "examples" / "gripper"
OLD_CONFTEST = 'pytest_plugins = ["smadrive.testing.plugin"]'
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


@pytest.mark.exhaustive
def test_the_example_of_the_guide_passes(pytester):
    pytester.makepyfile(EXAMPLE)
    pytester.runpytest_subprocess("-p", "no:cacheprovider").assert_outcomes(passed=3)


@pytest.mark.exhaustive
def test_own_rig_file_is_simulated_whatever_devices_it_names(pytester):
    rig = (Path(__file__).parents[3] / "configs" / "rigs" / "simulated.toml").read_text()
    own = pytester.path / "mine.toml"
    own.write_text(rig.replace('"simulated bench"', '"mine"').replace("/tmp/smadrive-sim", "/dev/ttyUSB9"))  # noqa: S108
    pytester.makepyfile(BY_NAME.format(rig=own))
    pytester.runpytest_subprocess("-p", "no:cacheprovider").assert_outcomes(passed=1)


@pytest.mark.exhaustive
@pytest.mark.parametrize(
    ("said", "told"),
    [
        ('rigg="in-process"', "*unknown part 'rigg'. Did you mean 'rig'?*"),
        ('"in-process"', "*'in-process' has no name. Write rig=, sim= or seed= before it*"),
    ],
)
def test_wrong_marker_gives_no_rig(pytester, said, told):
    pytester.makepyfile(MISTAKEN.format(said=said))
    result = pytester.runpytest_subprocess("-p", "no:cacheprovider")
    result.assert_outcomes(errors=1)
    result.stdout.fnmatch_lines([told])


@pytest.mark.exhaustive
def test_a_conftest_that_still_loads_the_plugin_works(pytester):
    pytester.makeconftest(OLD_CONFTEST)
    pytester.makepyfile("def test_rig(sma_rig):\n    assert not sma_rig.measure().armed")
    pytester.runpytest_subprocess("-p", "no:cacheprovider").assert_outcomes(passed=1)


@pytest.mark.exhaustive
def test_fixtures_are_listed_with_their_descriptions(pytester):
    result = pytester.runpytest_subprocess("--fixtures", "-p", "no:cacheprovider")
    result.stdout.fnmatch_lines(["sma_faults -- *", "    The faults of*", "sma_rig -- *", "    A rig whose*"])


def test_other_projects_do_not_pay_for_the_plugin(pytester):
    pytester.makepyfile(
        """
        import sys

        def test_nothing_is_imported():
            assert not {"numpy", "scipy", "firmware_sim", "smadrive.rig"} & sys.modules.keys()
        """
    )
    others = [argument for name in ("hypothesispytest", "zarr") for argument in ("-p", f"no:{name}")]
    pytester.runpytest_subprocess("-p", "no:cacheprovider", *others).assert_outcomes(passed=1)


@pytest.mark.exhaustive
def test_the_example_project_passes(pytester):
    shutil.copytree(PROJECT, pytester.path, dirs_exist_ok=True)
    pytester.runpytest_subprocess("-p", "no:cacheprovider").assert_outcomes(passed=3)
