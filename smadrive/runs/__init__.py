"""Recorded runs: the table of log columns, the recorder, metadata and metrics of a run, replay, plots and pages.

May import the rig and everything below it. Never belongs here: control decisions, device access, terminal output.
"""
