"""Cycling runs: a repeated reference, the metrics of each cycle, and the continuation of a run that ended early.

It may import the rig, and from `runs` the log, metadata, metrics and settings of a run; it opens no port.
"""
