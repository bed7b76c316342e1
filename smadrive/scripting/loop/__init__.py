"""The loop process of a script, and both ends of the link between script and loop process.

This package may import runs and everything below runs. Plots, files and arguments of a script do not
belong here.
"""
