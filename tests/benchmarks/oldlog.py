"""Logs as version 0.1 wrote them, in layout 1. The first logs of 0.1 have no checksums."""

import h5py
import numpy as np

from smadrive.runs.log.checksums import metadata_sum, row_sums
from smadrive.runs.log.old_layouts import COLUMNS_OF_1

NEW_COLUMNS = ("temperature_fault",)
"""Columns that 0.1 did not record."""


def to_layout_1(path):
    """Rewrite the log at `path` in layout 1, with its checksums."""
    with h5py.File(path, "r+") as file:
        entry = file["entry"]
        del file.attrs["layout"]
        entry.move("metadata", "about")
        for name in [name for name in NEW_COLUMNS if name in entry["data"]]:
            del entry["data"][name], file[name]
        for old, new in COLUMNS_OF_1.items():
            if new in entry["data"]:
                _rename(file, new, old)
        for column in entry["data"].values():
            del column.attrs["long_name"]
        _write_version(entry)
        _write_checksums(entry)


def without_checksums(path):
    """Rewrite the log at `path` as the first 0.1 wrote it: layout 1, no checksums, texts of variable length."""
    to_layout_1(path)
    with h5py.File(path, "r+") as file:
        del file["entry/checksums"], file.attrs["checksums"], file["entry/program_name"].attrs["version"]
        texts = [f"entry/about/{name}" for name in file["entry/about"]]
        for name in ("entry/start_time", "entry/program_name", *texts):
            text = file[name].asstr()[()]
            del file[name]
            file[name] = text
        _write_version(file["entry"])


def _write_version(entry):
    """Write the version whose logs had this layout, as a text of fixed length if the log has checksums."""
    attributes = entry["program_name"].attrs
    attributes["version"] = np.bytes_("0.1.0") if "checksums" in entry else "0.1.0"


def _rename(file, name, old):
    file["entry/data"].move(name, old)
    del file[name]
    file[old] = h5py.SoftLink(f"/entry/data/{old}")


def _write_checksums(entry):
    """Write the checksums again, because they depend on the names of the columns."""
    columns, metadata = entry["data"], {name: text[()].decode() for name, text in entry["about"].items()}
    version = bytes(entry["program_name"].attrs["version"]).decode()
    start_time = entry["start_time"][()].decode()
    entry["checksums/metadata"][()] = metadata_sum(start_time, version, list(columns), metadata)
    block = np.column_stack([columns[name][:] for name in sorted(columns)])
    entry["checksums/rows"][:] = row_sums(block, 0)
