"""A damaged log is refused. The reader never returns data that were not written."""

import random
from contextlib import suppress

import h5py
import numpy as np
import pytest
from benchmarks.oldlog import without_checksums
from marks import exhaustive

from smadrive.errors import DataError
from smadrive.runs.log.layout import MOST_OPEN_ROWS
from smadrive.runs.log.reader import read_log
from smadrive.runs.log.recorder import Recorder

COLUMNS = ("time_s", "temperature_c", "displacement_mm")
METADATA = {"rig": '{"name": "bench"}', "kind": "excitation", "note": "température 20 °C"}
ROWS = 300


def write(path, rows=ROWS, events=("armed", "disarmed")):
    recorder = Recorder(path, COLUMNS, METADATA)
    for n in range(rows):
        recorder.row((0.05 * n, 20.0 + n, float("nan")))
    for event in events:
        recorder.event(event)
    return recorder


@pytest.fixture(scope="module")
def sound(tmp_path_factory):
    path = tmp_path_factory.mktemp("log") / "run.h5"
    write(path).close()
    return path


@pytest.fixture(scope="module")
def unchecked(sound, tmp_path_factory):
    path = tmp_path_factory.mktemp("old") / "run.h5"
    path.write_bytes(sound.read_bytes())
    without_checksums(path)
    return path


def content(log):
    columns = {name: values.tobytes() for name, values in log.columns.items()}
    return columns, log.metadata, log.events, log.start_time, log.end_time, log.version


def place_of_damage(path):
    """Return the place that the reader's error names after the file. It is empty for the whole log."""
    with pytest.raises(DataError) as error:
        read_log(path)
    assert error.value.where.startswith(str(path))
    return error.value.where.removeprefix(str(path)).removeprefix(", ")


def overwrite(path, offset, data):
    with path.open("r+b") as file:
        file.seek(offset)
        file.write(data)


def place_of(path, name, row):
    """Return the offset of a value in the file, and its size in bytes."""
    with h5py.File(path) as file:
        dataset = file[name]
        chunk, within = divmod(row, dataset.chunks[0])
        offset = dataset.id.get_chunk_info_by_coord((chunk * dataset.chunks[0],)).byte_offset
        return offset + within * dataset.dtype.itemsize, dataset.dtype.itemsize


@pytest.fixture
def copy(sound, tmp_path):
    path = tmp_path / "copy.h5"
    path.write_bytes(sound.read_bytes())
    return path


@pytest.mark.parametrize("column", COLUMNS)
@pytest.mark.parametrize("bit", range(0, 64, 7))
def test_flipped_bit_of_a_value_is_found(copy, column, bit):
    offset, size = place_of(copy, f"entry/data/{column}", 123)
    value = int.from_bytes(copy.read_bytes()[offset : offset + size], "little") ^ (1 << bit)
    overwrite(copy, offset, value.to_bytes(size, "little"))
    assert place_of_damage(copy) == "sample 124"


def test_exchanged_rows_are_found(copy):
    data = copy.read_bytes()
    for name in (*(f"entry/data/{column}" for column in COLUMNS), "entry/checksums/rows"):
        (first, size), (second, _) = place_of(copy, name, 10), place_of(copy, name, 11)
        overwrite(copy, first, data[second : second + size])
        overwrite(copy, second, data[first : first + size])
    assert place_of_damage(copy) == "sample 11"


def test_changed_event_is_found(copy):
    offset, _ = place_of(copy, "entry/events/message", 0)
    overwrite(copy, offset, b"heated")
    assert place_of_damage(copy) == "event 1"


def test_changed_text_is_found(copy):
    overwrite(copy, copy.read_bytes().index(b'"bench"'), b'"fench"')
    assert place_of_damage(copy) == "metadata"


def test_lost_rows_of_an_ended_log_are_found(copy):
    with h5py.File(copy, "r+") as file:
        for name in (*(f"entry/data/{column}" for column in COLUMNS), "entry/checksums/rows"):
            file[name].resize(ROWS - 1, axis=0)
    assert place_of_damage(copy) == "end of the log"


def test_lost_checksums_are_found(copy):
    with h5py.File(copy, "r+") as file:
        file.move("entry/checksums", "entry/checkxums")
        del file.attrs["checksums"]
    assert place_of_damage(copy) == ""


@pytest.mark.parametrize(("rows", "is_lost"), [(0, True), (MOST_OPEN_ROWS, False)])
def test_overwritten_checksums_of_a_killed_run_are_found(tmp_path, rows, is_lost):
    """A killed writer leaves only a few rows without a checksum. More rows without a checksum are damage."""
    path, written = tmp_path / "run.h5", 2 * MOST_OPEN_ROWS
    write(path, written, ()).flush()
    lost = written - MOST_OPEN_ROWS - 1 if is_lost else written - MOST_OPEN_ROWS
    with h5py.File(path, "r+") as file:
        file["entry/checksums/rows"][lost:] = 0
    if is_lost:
        assert place_of_damage(path) == f"sample {lost + 1}"
    else:
        assert read_log(path).column("time_s").size == lost


@pytest.mark.parametrize("seeds", [range(40), exhaustive(range(40, 400))])
def test_damage_anywhere_is_an_error_or_harmless(sound, tmp_path, seeds):
    whole, expected, path = sound.read_bytes(), content(read_log(sound)), tmp_path / "run.h5"
    for seed in seeds:
        rng, data = random.Random(seed), bytearray(whole)
        for _ in range(rng.choice((1, 2, 4, 16))):
            data[rng.randrange(rng.choice((2000, 20_000, len(data))))] = rng.randrange(256)
        path.write_bytes(data)
        try:
            log = read_log(path)
        except DataError:
            continue
        assert content(log) == expected, f"seed {seed}"


def test_cut_file_is_refused(sound, tmp_path):
    whole, path = sound.read_bytes(), tmp_path / "run.h5"
    for size in range(1, len(whole), len(whole) // 40):
        path.write_bytes(whole[:size])
        with pytest.raises(DataError):
            read_log(path)


def test_cut_file_is_named_with_its_sizes(sound, tmp_path):
    whole, path = sound.read_bytes(), tmp_path / "run.h5"
    for size in (len(whole) // 3, len(whole) - 1):
        path.write_bytes(whole[:size])
        with pytest.raises(DataError) as error:
            read_log(path)
        assert error.value.what == "the end of the log is missing"
        assert error.value.value == f"{size} of {len(whole)} bytes"


@pytest.mark.parametrize("times_s", [(0.0, 0.1, 0.05), (0.0, 0.1, 0.1)])
def test_time_that_does_not_increase_is_refused(tmp_path, times_s):
    with Recorder(tmp_path / "run.h5", COLUMNS, METADATA) as recorder:
        for time_s in times_s:
            recorder.row((time_s, 20.0, 0.0))
    assert place_of_damage(tmp_path / "run.h5") == "sample 3"


def test_log_without_checksums_is_read_with_a_warning(sound, unchecked):
    old, new = read_log(unchecked), read_log(sound)
    assert content(old)[:-1] == content(new)[:-1]
    assert old.version == "0.1.0"
    assert new.caveats == ()
    assert len(old.caveats) == 1


@pytest.mark.exhaustive
def test_damaged_log_without_checksums_raises_only_data_errors(unchecked, tmp_path):
    whole, path = unchecked.read_bytes(), tmp_path / "run.h5"
    for seed in range(300):
        rng, data = random.Random(seed), bytearray(whole)
        for _ in range(rng.choice((1, 4))):
            data[rng.randrange(12_000)] = rng.randrange(256)
        path.write_bytes(data)
        with suppress(DataError):
            assert np.isfinite(read_log(path).columns["time_s"]).all()


@pytest.mark.parametrize("text", ["{", "[1", "[" * 100_000, "9" * 5000, "null"])
def test_invalid_json_in_the_metadata_is_a_data_error(tmp_path, text):
    with Recorder(tmp_path / "run.h5", COLUMNS, {"devices": text}) as recorder:
        recorder.row((0.0, 20.0, 0.0))
    log = read_log(tmp_path / "run.h5")
    with pytest.raises(DataError) as error:
        log.parsed("devices", lambda value: value["name"])
    assert error.value.where == f"{log.path}: devices"
