"""A rig that a script has opened, and the wire identified with it, for all tests of a file."""

import os
from pathlib import Path

import pytest

import smadrive


@pytest.fixture(scope="module")
def rig(tmp_path_factory):
    before = Path.cwd()
    os.chdir(tmp_path_factory.mktemp("logs"))
    with smadrive.open_rig("in-process") as opened:
        yield opened
    os.chdir(before)


@pytest.fixture(scope="module")
def wire(rig):
    return smadrive.identify(rig.excite())
