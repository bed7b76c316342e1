"""Records of runs: the HDF5 log, tables of samples as CSV, and the report that shows both."""
