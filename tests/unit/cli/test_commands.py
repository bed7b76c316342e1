"""Each file of the folder is a command."""

from pathlib import Path

import smadrive.cli
from smadrive.cli.parsing.app import COMMANDS, MODULES


def test_folder_has_one_file_for_each_command():
    files = {path.stem for path in Path(smadrive.cli.__file__).parent.glob("*.py")} - {"__init__"}
    assert files == {MODULES.get(name, name) for name in COMMANDS}
