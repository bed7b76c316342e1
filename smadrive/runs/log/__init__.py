"""The log file: its layout, writer, reader and checksums, and the layouts of older versions.

It may import the table of log columns, the kinds of runs, files, numerics and h5py. This package does not interpret a
column or a metadata text; `runs` does.
"""
