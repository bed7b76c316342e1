"""A rig that a script has opened for all tests of a file, and a wire identified on the same simulated device."""

import os
import pickle
import shutil
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
def wire(rig, identified, once_per_run):
    """The wire of the log `excitation.h5`, which lies in the folder of the rig's logs."""
    log_file = shutil.copy(identified.log.path, "excitation.h5")

    def identify(folder):
        (folder / "wire.pickle").write_bytes(pickle.dumps(smadrive.identify(log_file)))

    return pickle.loads((once_per_run("scripted", identify) / "wire.pickle").read_bytes())  # noqa: S301 (of this run)
