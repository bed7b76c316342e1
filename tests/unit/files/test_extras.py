"""A missing optional package is named together with the command that installs its extra for this Python."""

import re
import shlex
import sys
import tomllib
from pathlib import Path

import pytest

from smadrive.errors import ConfigError
from smadrive.files.extras import PACKAGES, check_extra, install_cure

PROJECT = tomllib.loads((Path(__file__).parents[3] / "pyproject.toml").read_text(encoding="utf-8"))["project"]
EACH = [(extra, module, package) for extra, packages in PACKAGES.items() for module, package in packages.items()]


@pytest.mark.parametrize(("extra", "package"), [(extra, package) for extra, _, package in EACH])
def test_extra_installs_the_package(extra, package):
    requirements = PROJECT["optional-dependencies"][extra]
    assert package in {re.split(r"[\[>=<]", requirement)[0] for requirement in requirements}


@pytest.mark.parametrize(("extra", "module", "package"), EACH)
def test_missing_package_is_named_with_its_cure(extra, module, package, monkeypatch):
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(ConfigError) as raised:
        check_extra(extra, "--option")
    assert (raised.value.what, raised.value.where) == (f"needs {package}", "--option")
    assert raised.value.cure == install_cure(f"smadrive[{extra}]")


def test_folder_without_a_package_does_not_count(tmp_path, monkeypatch):
    (tmp_path / "paho").mkdir()
    monkeypatch.delitem(sys.modules, "paho", raising=False)
    monkeypatch.setattr(sys, "path", [str(tmp_path)])
    with pytest.raises(ConfigError):
        check_extra("mqtt", "--publish")


def test_cure_installs_for_the_python_that_runs(monkeypatch):
    monkeypatch.setattr(sys, "executable", "/opt/my python/bin/python")
    command = install_cure("smadrive[tune]").split("`")[1]
    assert shlex.split(command) == ["/opt/my python/bin/python", "-m", "pip", "install", "smadrive[tune]"]
