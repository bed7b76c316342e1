"""The log file: its layout, writer, reader and checksums, and the layouts of older versions.

May import the table of log columns, files and errors, numpy and h5py. Never belongs here: the meaning of a column or of
a metadata text, which the modules above read.
"""
