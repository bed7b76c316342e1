"""Runs side by side: their metrics and the settings in which they differ.

It reads logs and prints nothing; `smadrive.runs.figures` draws the runs, `smadrive.cli` makes the page.
"""
