"""A file that cannot be fitted is an error that says why."""

from pathlib import Path

import pytest

from smadrive.errors import DataError
from smadrive.identification.wire import FitSettings
from smadrive.runs.record_fit import INPUT, OUTPUT, fit_file


def what_of(path: Path) -> str:
    with pytest.raises(DataError) as caught:
        fit_file(path, (INPUT, OUTPUT), FitSettings())
    assert str(caught.value.where) == str(path)
    assert caught.value.cure
    return caught.value.what


def test_missing_file_is_told_from_a_file_of_another_kind(tmp_path):
    other = tmp_path / "notes.txt"
    other.touch()
    missing = {what_of(tmp_path / name) for name in ("log.h55", "log.h5", "table.csv")}
    assert len(missing) == 1
    assert what_of(other) not in missing
