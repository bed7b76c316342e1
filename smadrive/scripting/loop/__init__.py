"""The process of the loop of a script, and both ends of the link to it.

May import runs and everything below it, and the scheduling of tuning/link. Plots, files and arguments of a script do
not belong here.
"""
