"""A rig that a script has opened for all tests of a file, and a wire identified on the same simulated device."""

import os
import shutil
from dataclasses import replace
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
def wire(rig, identified):
    """The wire of the log `excitation.h5`, which lies in the folder of the rig's logs.

    It has no file: the runs of these tests add to no health record.
    """
    shutil.copy(identified.log.path, "excitation.h5")
    return replace(smadrive.load_wire(identified.wire_file), source="")
