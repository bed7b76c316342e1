"""A log that refers to other files is refused before any of them is read."""

import os

import h5py
import numpy as np
import pytest

from smadrive.errors import DataError
from smadrive.runs.log.errors import ForeignContentError
from smadrive.runs.log.reader import read_log
from smadrive.runs.log.recorder import Recorder

COLUMNS = ("time_s", "temperature_c")
SECRET = 4321.0
COLUMN = "entry/data/temperature_c"


@pytest.fixture
def log_file(tmp_path):
    path = tmp_path / "run.h5"
    with Recorder(path, COLUMNS, {"rig": "bench"}) as recorder:
        for n in range(10):
            recorder.row((0.05 * n, 20.0))
    return path


@pytest.fixture
def secret_file(tmp_path):
    """Another log, whose content must not be read."""
    path = tmp_path / "secret.h5"
    with Recorder(path, COLUMNS, {"rig": "secret"}) as recorder:
        for n in range(10):
            recorder.row((0.05 * n, SECRET))
    return path


def external_link_to_a_column(file, secret):
    del file[COLUMN]
    file[COLUMN] = h5py.ExternalLink(secret, COLUMN)


def external_link_to_a_text(file, secret):
    del file["entry/metadata/rig"]
    file["entry/metadata/rig"] = h5py.ExternalLink(secret, "entry/metadata/rig")


def external_link_to_the_whole_entry(file, secret):
    del file["entry"]
    file["entry"] = h5py.ExternalLink(secret, "entry")


def external_link_beside_the_entry(file, secret):
    file["more"] = h5py.ExternalLink(secret, "entry")


def external_raw_storage(file, secret):
    del file[COLUMN]
    file.create_dataset(COLUMN, (10,), "f8", external=[(str(secret), 0, 80)])


def virtual_dataset(file, secret):
    del file[COLUMN]
    layout = h5py.VirtualLayout((10,), "f8")
    layout[:] = h5py.VirtualSource(secret, COLUMN, (10,))
    file.create_virtual_dataset(COLUMN, layout)


def soft_link_to_a_mounted_file(file, secret):
    file["mounted"] = h5py.ExternalLink(secret, "entry/data")
    del file[COLUMN]
    file[COLUMN] = h5py.SoftLink("/mounted/temperature_c")


def soft_link_to_another_column(file, secret):
    del file[COLUMN]
    file[COLUMN] = h5py.SoftLink("/entry/data/time_s")


def filter_of_a_plugin(file, secret):
    creation = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    creation.set_chunk((10,))
    creation.set_filter(32_000, h5py.h5z.FLAG_OPTIONAL, (1,))
    del file[COLUMN]
    h5py.h5d.create(
        file["entry/data"].id, b"temperature_c", h5py.h5t.IEEE_F64LE, h5py.h5s.create_simple((10,)), dcpl=creation
    )


def more_values_than_the_file_can_hold(file, secret):
    del file[COLUMN]
    file.create_dataset(COLUMN, (10**12,), "f8", chunks=(1024,))


def groups_that_contain_themselves(file, secret):
    file["entry/metadata/again"] = file["entry/metadata"]


FOREIGN = [
    external_link_to_a_column,
    external_link_to_a_text,
    external_link_to_the_whole_entry,
    external_link_beside_the_entry,
    external_raw_storage,
    virtual_dataset,
    soft_link_to_a_mounted_file,
    soft_link_to_another_column,
    filter_of_a_plugin,
    more_values_than_the_file_can_hold,
    groups_that_contain_themselves,
]


@pytest.mark.parametrize("change", FOREIGN)
def test_log_that_refers_to_other_content_is_refused(log_file, secret_file, change):
    with h5py.File(log_file, "r+") as file:
        change(file, secret_file)
    with pytest.raises(DataError) as error:
        read_log(log_file)
    assert error.value.where == str(log_file)
    assert isinstance(error.value.__context__, ForeignContentError)


@pytest.mark.parametrize("change", FOREIGN)
def test_file_that_a_log_refers_to_is_never_opened(log_file, tmp_path, change):
    """If the reader opened the pipe, it would wait for ever, because nothing writes into the pipe."""
    os.mkfifo(tmp_path / "pipe")
    with h5py.File(log_file, "r+") as file:
        change(file, tmp_path / "pipe")
    with pytest.raises(DataError):
        read_log(log_file)


def test_log_with_its_own_links_is_read(log_file):
    np.testing.assert_array_equal(read_log(log_file).column("temperature_c"), np.full(10, 20.0))
