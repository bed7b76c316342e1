"""docs/device-profiles.md tells every key that a profile may have, and no other; its example loads."""

import re
import tomllib

import pytest

from smadrive.device import sections
from smadrive.device.profile import Profile, load_profile
from smadrive.device.registers import Register
from smadrive.shipped import configs_dir

DOCUMENT = (configs_dir().parent / "docs" / "device-profiles.md").read_text(encoding="utf-8")
EXAMPLE = re.search(r"```toml\n(.*?)```", DOCUMENT, re.DOTALL)[1]
TABLES = {
    "## [profile]": sections.Head,
    "## [serial]": sections.Serial,
    "## [tcp]": sections.Tcp,
    "## [timing]": sections.Timing,
    "## [identify]": sections.Identify,
    "## [roles]": sections.Roles,
    "## [registers.NAME]": Register,
    "## [[variants]]": sections.Variant,
    "In `registers`:": sections.Override,
    "## [[forbidden]]": sections.Forbidden,
    "## [[write_order]]": sections.WriteOrder,
    "## [[safe_state]]": sections.SafeWrite,
    "## [[vectors]]": sections.Vector,
}


def rows(heading):
    start = DOCUMENT.index(heading) + len(heading)
    end = re.search(r"^(## |In `registers`)", DOCUMENT[start:] + "\n## ", re.MULTILINE).start()
    return re.findall(r"^\| `(\w+)` \| (.+) \| `(.+)` \|$", DOCUMENT[start : start + end], re.MULTILINE)


@pytest.mark.parametrize(("heading", "model"), TABLES.items(), ids=list(TABLES))
def test_every_key_is_told_and_no_other(heading, model):
    assert [key for key, _, _ in rows(heading)] == [field.alias or name for name, field in model.model_fields.items()]


@pytest.mark.parametrize("heading", TABLES)
def test_the_examples_are_toml(heading):
    for key, _, example in rows(heading):
        assert key in tomllib.loads(f"{key} = {example}")


def test_every_table_is_told():
    told = {re.search(r"\w+", heading)[0] for heading in TABLES if heading.startswith("##")}
    assert told | {"schema"} == {field.alias or name for name, field in Profile.model_fields.items()}


def test_the_example_loads(tmp_path):
    path = tmp_path / "my-supply.toml"
    path.write_text(EXAMPLE, encoding="utf-8")
    assert load_profile(path).profile.id == "my-supply"
