"""Metrics of a recorded run: its tracking error, what the heater and the wire did, and reasons to distrust them.

It may import the log and the metadata of a run. Plots, pages and terminal output never belong here.
"""
