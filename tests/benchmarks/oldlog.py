"""A log as version 0.1 wrote it: without checksums, with texts of variable length."""

import h5py


def strip_checksums(path):
    """Make the log at `path` such a log."""
    with h5py.File(path, "r+") as file:
        del file["entry/checksums"], file.attrs["checksums"], file["entry/program_name"].attrs["version"]
        texts = [f"entry/about/{name}" for name in file["entry/about"]]
        for name in ("entry/start_time", "entry/program_name", *texts):
            text = file[name].asstr()[()]
            del file[name]
            file[name] = text
        file["entry/program_name"].attrs["version"] = "0.1.0"
