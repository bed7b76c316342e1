"""Recorded runs: the table of log columns, the recorder, metadata and metrics of a run, replay, plots and pages.

It may import the rig and everything below it. Control decisions, device access and terminal output never belong here.
"""
