"""Cycling runs: a repeated reference, the metrics of each cycle, and the continuation of a run that ended early.

It may import the log, the metadata and the metrics of a run; it opens no port.
"""
