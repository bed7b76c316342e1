"""Cycling runs: a reference that is repeated many times, the metrics of each cycle, and the rest of an ended run.

It may import the log, the metadata and the metrics of a run; it opens no port.
"""
