"""The loop process of a script, and both ends of the link between script and loop process.

This package may import runs, everything below runs, and the scheduling of tuning/link. Plots, files and arguments of a
script do not belong here.
"""
