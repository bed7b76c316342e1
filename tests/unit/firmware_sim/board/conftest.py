"""The tests of the board core are skipped where it cannot be built."""

import pytest

from firmware_sim.board.library import missing_tool


@pytest.fixture(autouse=True)
def _compiler():
    if (tool := missing_tool()) is not None:
        pytest.skip(f"needs a C compiler and make (Debian packages gcc and make): '{tool}' is missing")
