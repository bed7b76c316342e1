"""Checks that an HDF5 file contains all of its content, without references to other files.

In HDF5, a link, a dataset or a filter can refer to another file, to raw bytes of any file, or to a plugin that HDF5
loads and runs. With such a reference, a log from a stranger could copy private files of the user into a report. So
every object of the file is checked before any value is read.
"""

from __future__ import annotations

import h5py

from smadrive.runs.log.errors import ForeignContentError

MOST_DEPTH = 8
"""Largest number of levels below the root. A log has three, as in `/entry/data/time_s`."""

MOST_OBJECTS = 10_000
"""Largest number of links in the whole file. A log has about fifty."""


def check_self_contained(file: h5py.File, size: int) -> None:
    """Raise ForeignContentError when the file, of `size` bytes, refers to content outside of itself.

    A filter, too many levels or links, or a dataset of more than `size` bytes raise the same error.
    """
    places = [(name, MOST_DEPTH, file, name) for name in file if not _is_alias(file, name)]
    count = 0
    while places:
        place, depth, group, name = places.pop()
        count += 1
        if depth == 0 or count > MOST_OBJECTS:
            raise ForeignContentError(f"more than {MOST_DEPTH} levels or {MOST_OBJECTS} links at {place}")
        inner = _opened(group, name, place)
        if isinstance(inner, h5py.Group):
            places += [(f"{place}/{below}", depth - 1, inner, below) for below in inner]
        elif isinstance(inner, h5py.Dataset):
            _check_dataset(inner, place, size)


def _is_alias(file: h5py.File, name: str) -> bool:
    """Return True if `name` is a link at the root that leads to the column of this name. Every log has such links."""
    link = file.get(name, getlink=True)
    return isinstance(link, h5py.SoftLink) and link.path == f"/entry/data/{name}"


def _opened(group: h5py.Group, name: str, place: str) -> object:
    try:
        link = group.get(name, getlink=True)
    except TypeError:  # a user-defined link
        link = None
    if not isinstance(link, h5py.HardLink):
        raise ForeignContentError(f"{place} is a link, and a log has no such links")
    return group[name]


def _check_dataset(dataset: h5py.Dataset, place: str, size: int) -> None:
    creation = dataset.id.get_create_plist()
    if creation.get_layout() == h5py.h5d.VIRTUAL or creation.get_external_count():
        raise ForeignContentError(f"the values of {place} are in another file")
    if creation.get_nfilters():
        raise ForeignContentError(f"{place} passes through a filter; unpack the log with `h5repack -f NONE`")
    claimed = (dataset.size or 0) * dataset.id.get_type().get_size()
    if claimed > size:
        raise ForeignContentError(f"{place} claims {claimed} bytes, the file has {size}")
