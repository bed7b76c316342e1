"""A trace needs a folder that can be made; otherwise no port is opened."""

import pytest

from smadrive.errors import ConfigError
from smadrive.rig.config import load_rig
from smadrive.rig.rig import Rig


@pytest.mark.parametrize("place", ["file", "file/traces"])
def test_file_in_place_of_the_trace_folder_is_an_error_with_a_cure(tmp_path, place):
    (tmp_path / "file").touch()
    with pytest.raises(ConfigError) as error, Rig(load_rig("in-process"), trace_folder=tmp_path / place):
        pass
    assert error.value.where == str(tmp_path / place)
    assert error.value.cure
